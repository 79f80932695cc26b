"""The Union-Rect grammar."""
