"""What runs inside an FMU: copied into its package beside model.json, never imported from here.

None of it imports anything of this repository but its neighbours in this folder.
"""
