"""Experiments that tell answers apart: drives that are predicted, and the margins expected of them.

settings (what a driver can set) ─▶ drives (predicted) ─▶ margins (of each pair of answers) ─▶ choice
"""
