//! Weights of the points around a position.

/// Weight of a point as a function of its distance d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Weights {
    /// (1 - d^2/r^2)^2 within the radius r: as smooth as a Gaussian, zero at the radius, no exponential.
    Compact,
    /// exp(-d^2/h^2) within the radius (Kolluri 2008; IMLS-SLAM's form).
    Gaussian {
        /// h, m.
        h_m: f64,
    },
}

/// Kernel of the points that form a surface, see [`crate::LocalMap::surface`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kernel {
    /// Radius beyond which points have no weight, m; at most 0.5.
    pub radius_m: f64,
    /// Weights within the radius.
    pub weights: Weights,
}
