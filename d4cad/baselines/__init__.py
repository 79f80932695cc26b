"""What the paper compares Stochastic Rewrite Descent with."""
