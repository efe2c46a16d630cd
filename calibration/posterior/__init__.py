"""Posterior of cohesion, friction angle and drawbar margin, estimated by a mixture density network; soil-change alarm.

| module | content |
|---|---|
| `window` | features of a window of measurements, and what is known of the calibration |
| `mixture` | mixture of Gaussians: means, quantiles, samples |
| `estimator` | the estimator on the rover (NumPy and onnxruntime only) |
| `simulated_rovers` | simulated measurements for training and evaluation |
| `training_examples`, `training`, `onnx_export` | training set, network and optimisation, export to ONNX |
| `change_detection` | CUSUM detector of a change of soil |
"""
