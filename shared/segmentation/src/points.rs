//! Networks on points: [`PointNetworkSpec`] names one, [`PointNetworkSpec::plan`] searches the neighborhoods of a
//! batch, and [`PointNetworkSpec::run`] computes a score of each class for each point. All have gradients in training.
//!
//! | network | kind | uses |
//! |---|---|---|
//! | [`PointNet`] | `pointnet` | one global feature of a cloud |
//! | [`PointNet2`] | `pointnet2` | groups around farthest points, on several scales |
//! | [`KpConv`] | `kpconv` | kernel point convolutions on grids that get coarser |
//! | [`WaffleIron`] | `waffle_iron` | 2D convolutions on three coordinate planes |
//!
//! Weights have the names and shapes of the `PyTorch` code of the publications. `lab/peers/point_networks.py` has the same networks
//! in `PyTorch`; the tests compare outputs, gradients and running statistics with it.

mod batch;
mod cells;
mod features;
mod model;
mod parameters;
mod pass;
mod prediction;
mod published;
mod search;
mod settings;
mod spec;
mod spheres;
mod squares;
mod waffle_iron;

pub use batch::PointBatch;
pub use cells::{CellCloud, GriddedCells};
pub use features::PointFeature;
pub use model::PointModel;
pub use parameters::{Parameter, Parameters, Start};
pub use pass::Pass;
pub use prediction::{CloudPrediction, RegionInput, Regions, Votes};
pub use published::{Abstraction, KpConv, PointNet, PointNet2, Scale};
pub use settings::{ARCHITECTURE, PointSettings, VERSION};
pub use spec::{PointNetworkSpec, PointPlan};
pub use spheres::{SphereSettings, sphere};
pub use squares::{Region, SquareSettings};
pub use waffle_iron::{PlaneConvolution, WaffleIron};
