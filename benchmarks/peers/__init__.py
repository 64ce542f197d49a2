"""What railfmi is compared with: the same computation in the plain way, by other tools or by hand."""
