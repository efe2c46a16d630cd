"""The paper's method, step by step and as it stands: its equations, its 504 pairs, its network, its sizing study.

"Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50 (2013)
165–174. What the paper leaves open is chosen once, where it is needed, and said there. What goes beyond it lies outside
this folder.
"""
