"""A fleet of short rig records, made by the truth model, through `railfmi fleet`."""
