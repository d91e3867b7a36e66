//! Adjustment of a survey: several drives through the same streets become one result, tied to control points.
//!
//! | idea | module |
//! |---|---|
//! | drives and submaps in one east-north-up frame | `drives` |
//! | surfaces and columns of a submap, from its points | `surfaces` |
//! | where drives meet, metres off | `meetings` |
//! | relative poses of near submaps, within a centimetre | `matches` |
//! | control and check points | `control` |
//! | one pose graph over the submaps of all drives | `network` |
//! | residuals of points, height differences between drives | `residuals`, `ground` |
//! | the steps | `survey` |
//!
//! Start reading with `survey.rs`. Submaps move as rigid bodies; the clouds of the runs are read and never changed. Drives that do
//! not fit, and control points that contradict the others, are named and do not bend the result. The same runs and points give the
//! same result, for any number of threads.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

mod control;
mod drives;
mod error;
mod ground;
mod matches;
mod meetings;
mod network;
mod residuals;
mod surfaces;
mod survey;

pub use control::{ControlPoint, SeenControl, control_points};
pub use drives::{Submap, Submaps, SurveyDrive};
pub use error::SurveyError;
pub use matches::{Match, disagreement};
pub use residuals::{MeanResidual, accuracy, mean_residuals};
pub use survey::{Survey, Weighed, adjust_survey};
