//! Sensor axes that are parallel to body axes, in any order and sense.

use geometry::Vector3;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Axis and sense of the unit along each axis of the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axes {
    of: [usize; 3],
    sign: [f64; 3],
}

/// The orders of three axes.
const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];

impl Axes {
    /// The axes of the body.
    pub const BODY: Self = Self { of: [0, 1, 2], sign: [1.0; 3] };

    /// All 48 axis combinations, the axes of the body first.
    pub fn all() -> impl Iterator<Item = Self> {
        let sign = |bits: u32, axis: u32| if bits >> axis & 1 == 1 { -1.0 } else { 1.0 };
        let signs = move |of: [usize; 3]| (0..8_u32).map(move |bits| (of, [0, 1, 2].map(|axis| sign(bits, axis))));
        ORDERS.into_iter().flat_map(signs).map(|(of, sign)| Self { of, sign })
    }

    /// Transforms a vector of the unit to body axes.
    pub fn in_body(&self, of_unit: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.sign[axis] * of_unit[self.of[axis]])
    }

    /// The matrix of [`Self::in_body`].
    pub fn matrix(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|row, col| if self.of[row] == col { self.sign[row] } else { 0.0 })
    }

    /// Sum of the products of body and unit vectors, from the sum of their outer products.
    pub fn product(&self, body_by_unit: &Matrix3<f64>) -> f64 {
        (0..3).map(|axis| self.sign[axis] * body_by_unit[(axis, self.of[axis])]).sum()
    }
}

impl fmt::Display for Axes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |axis: usize| {
            let sense = if self.sign[axis] < 0.0 { "-" } else { "" };
            format!("{sense}{}", ["x", "y", "z"][self.of[axis]])
        };
        write!(f, "x, y, z of the body are {}, {}, {} of the unit", name(0), name(1), name(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_all_different_and_half_of_them_mirrored() {
        let all: Vec<Axes> = Axes::all().collect();
        assert_eq!((all.len(), all[0]), (48, Axes::BODY));
        assert!(all.iter().enumerate().all(|(i, a)| all[..i].iter().all(|b| a != b)));
        assert_eq!(all.iter().filter(|axes| axes.matrix().determinant() > 0.0).count(), 24);
        let v = Vector3::new(1.0, 2.0, 3.0);
        for axes in &all {
            assert_eq!(axes.in_body(&v), axes.matrix() * v);
            let body = Vector3::new(-0.4, 5.0, 0.3);
            assert!((axes.product(&(body * v.transpose())) - body.dot(&axes.in_body(&v))).abs() < 1e-12);
        }
        assert_eq!(all[9].to_string(), "x, y, z of the body are -y, z, x of the unit");
    }
}
