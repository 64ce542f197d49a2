"""Ablation: what each limit of the policy does to the answers to a frozen challenge."""
