"""Car body on two bogies, lateral, yaw and roll; equations in README.md."""
