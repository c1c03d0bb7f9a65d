"""What people see: the report and the Rerun recording. Import what you need; this package imports none."""
