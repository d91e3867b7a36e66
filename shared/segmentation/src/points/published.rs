//! Published networks on points, for comparison (thesis tables 6.9 and 6.10). No shipped model uses one.
//!
//! | module | publication |
//! |---|---|
//! | `pointnet` | Qi et al., CVPR 2017 |
//! | `pointnet2` | Qi et al., NeurIPS 2017, multi-scale grouping |
//! | `kpconv` | Thomas et al., ICCV 2019, KP-FCNN with rigid kernels |

mod kernel_points;
mod kpconv;
mod pointnet;
mod pointnet2;

pub use kpconv::KpConv;
pub(super) use kpconv::KpConvPlan;
pub use pointnet::PointNet;
pub(super) use pointnet2::PointNet2Plan;
pub use pointnet2::{Abstraction, PointNet2, Scale};
