"""Published rigs, one file each: what is known of them, what the lab says."""
