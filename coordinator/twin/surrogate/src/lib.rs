//! Surrogates of the track model: from a feature vector back to the track's parameters.
//!
//! This crate contains Gaussian processes with the exponential kernel, the scaling of their inputs, the fit
//! of their hyper-parameters, the model selector, the error measures and the files of the models. Other
//! crates define the power of a bin (signal), store the training cases (library) and combine the windows of a
//! recording (evaluation).
//!
//! # Example: the variance is small at the training entries and equals the signal variance far away
//!
//! ```
//! use faer::Mat;
//! use tracktwin_surrogate::{Factor, Hyperparameters, distances, distances_within};
//!
//! let inputs = Mat::from_fn(5, 1, |i, _| i as f64);
//! let no_mean = |rows: usize| Mat::<f64>::zeros(rows, 0);
//! let at = Hyperparameters { length: 2.0, noise_ratio: 1e-6 };
//! let factor = Factor::new(distances_within(inputs.as_ref()).as_ref(), no_mean(5).as_ref(), at)?;
//!
//! let new = Mat::from_fn(2, 1, |i, _| [2.0, 100.0][i]);
//! let apart = distances(inputs.as_ref(), new.as_ref());
//! let variances = factor.variances(apart.as_ref(), no_mean(2).as_ref());
//! // In parts of the signal's variance.
//! assert!(variances[0] < 1e-4 && (variances[1] - 1.0).abs() < 1e-3, "{variances:?}");
//! # Ok::<(), tracktwin_surrogate::Error>(())
//! ```

mod cholesky;
mod coarse;
mod distance;
mod domain;
mod error;
mod exponential;
mod features;
mod fit;
mod gaussian_process;
mod group;
mod input_map;
mod kernel;
mod ladder;
mod polynomial;
mod selector;
mod spread;
mod stack;
mod store;
mod train;
mod training_set;
mod validate;
mod whitening;

pub use distance::{distances, distances_within};
pub use domain::{Beyond, Domain, Judgement, Side};
pub use error::Error;
pub use features::FeatureColumns;
pub use fit::{HyperparameterFit, MeanFunction, fit};
pub use gaussian_process::{Factor, Weights};
pub use group::{GroupKey, ModelGroup, ModelScore, ParameterModel, Prediction, Tested};
pub use input_map::{InputMap, InputScaling};
pub use kernel::{Hyperparameters, correlation};
pub use selector::{Neighbour, Selection, Selector, mape};
pub use spread::Spread;
pub use stack::Stack;
pub use store::{FORMAT, INDEX, Trained};
pub use train::{ENTRIES_MIN, Progress, TrainOptions, train};
pub use training_set::{Split, TrainingSet};
pub use validate::{Folds, coverage, folds, mase};
