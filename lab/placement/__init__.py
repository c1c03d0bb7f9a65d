"""Where sensors and actuators should go, what each choice costs, and which signals to use."""
