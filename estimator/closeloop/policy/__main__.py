"""Prints the tables of docs/policy.md: python -m estimator.closeloop.policy."""

from estimator.closeloop.policy import DEFAULT

if __name__ == "__main__":
    print(DEFAULT.table(), end="")
