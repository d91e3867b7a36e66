//! IMLS-SLAM as published (J.-E. Deschaud, ICRA 2018; thesis section 2.5.1), for comparison with [`crate::Odometry`].
//!
//! Steps for each sweep, with the paper's sections:
//! 1. The previous motion is repeated. It predicts the pose at the end of the sweep and deskews the sweep to it (III).
//! 2. Small objects are removed, the ground stays (III-A).
//! 3. Normals and planarity of all points follow from the range image (III-B).
//! 4. Nine lists choose samples near the model (III-C).
//! 5. Samples are projected to the implicit surface of the model and matched point to plane, a fixed number of times (III-D).
//! 6. The sweep is deskewed again with the pose found. All its points enter the model, which keeps the last sweeps (III).
//!
//! Not in the paper: the speed of the first two sweeps is searched because the paper's drives begin at rest; a sweep
//! whose samples have too few model points nearby keeps the prediction, and several such sweeps in a row start a new
//! model; covariance, moving points and the thinned map for loop closures come from [`crate::Odometry`].

mod matching;
mod model;
mod odometry;
mod saved_bytes;
mod sweep_points;

pub use odometry::{ImlsOdometry, ImlsState};

/// Constants of the paper.
#[derive(Clone, Debug, PartialEq)]
pub struct ImlsSettings {
    /// Samples of each of the nine lists (s).
    pub per_list: usize,
    /// Width of the Gaussian weights, m (h).
    pub h_m: f64,
    /// Largest distance of a sample from the nearest point of the model, and radius of the surface around it, m (r).
    pub radius_m: f64,
    /// Iterations of a match.
    pub rounds: u32,
    /// Sweeps in the model (n).
    pub sweeps: u32,
}

impl Default for ImlsSettings {
    fn default() -> Self {
        Self { per_list: 100, h_m: 0.06, radius_m: 0.2, rounds: 20, sweeps: 100 }
    }
}
