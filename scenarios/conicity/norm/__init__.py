"""The norm's test of a calculation of conicities: exact profiles (step 1), measured points (step 2)."""
