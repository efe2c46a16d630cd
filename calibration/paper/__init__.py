"""The paper's method as published: its equations, its 504 training pairs, its perceptron, its sizing study.

"Estimating terrain parameters for a rigid wheeled rover using neural networks", Journal of Terramechanics 50 (2013)
165–174. Choices that the paper leaves open are documented in the module that makes them. Extensions of the method are
in `calibration.terrain`, `calibration.drivetrain` and `calibration.posterior`.

| module | content |
|---|---|
| `equations` | Eqs 1–10 |
| `load_from_current` | Eqs 11–14 |
| `training_set` | Steps 1–15: the 504 pairs |
| `perceptron` | Secs 2.2, 2.3: the network 3:H:2, scaling, initial weights |
| `backpropagation` | Sec. 2.4: training |
| `onnx_export` | the trained network as an ONNX model with a model card |
| `sizing` | Sec. 2.3: the study of the number of hidden neurons |
| `sizing_speed` | the study's speed, compared with scikit-learn's |
| `least_squares` | the classical estimator of Iagnemma et al. |
"""
