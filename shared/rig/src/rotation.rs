//! Rotations in their usual notations: quaternions, matrices, and Euler angles with a named order.

use geometry::{Quaternion, UnitQuaternion, Vector3};
use nalgebra::{Matrix3, Rotation3};
use std::f64::consts::PI;

/// Supported notations of rotations.
pub const FORMS: &str = "\"quaternion xyzw 0,0,0,1\", \"quaternion wxyz 1,0,0,0\", \"matrix\" with nine numbers row by row, \
                         \"euler intrinsic zyx deg 90,1.5,0\", \"euler extrinsic xyz rad 0,0.1,1.57\" or \"rpy deg 0,1.5,90\"";
/// Largest deviation of a norm, or of the product of two rows, from the value of a rotation.
const TOLERANCE: f64 = 1e-3;

/// A text or numbers that are not a rotation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RotationError {
    /// Words that are not recognized.
    #[error("rotation {text:?}: {rule}; expected {FORMS}")]
    Form {
        /// The text.
        text: String,
        /// The violated rule.
        rule: String,
    },
    /// A quaternion whose length is not 1.
    #[error("the quaternion has length {norm:.4}; must be 1. Is it a unit quaternion, with all four numbers?")]
    Norm {
        /// Its length.
        norm: f64,
    },
    /// A matrix that mirrors.
    #[error(
        "the matrix has determinant {determinant:.3}: it mirrors one axis, which no mounting does. Change the sense of one axis of the \
         sensor's frame, so that the frame is right-handed"
    )]
    Mirrored {
        /// The determinant.
        determinant: f64,
    },
    /// A matrix that is not a rotation.
    #[error("the rows of the matrix differ from unit vectors at right angles by {off:.4}; must be below {TOLERANCE}")]
    Matrix {
        /// The largest difference of a product of rows.
        off: f64,
    },
}

/// Reads a rotation in one of [`FORMS`].
pub fn parse(text: &str) -> Result<UnitQuaternion<f64>, RotationError> {
    let error = |rule: &str| RotationError::Form { text: text.chars().take(200).collect(), rule: rule.to_owned() };
    let is_separator = |c: char| c.is_whitespace() || c == ',';
    let words: Vec<&str> = text.split(is_separator).filter(|word| !word.is_empty()).collect();
    let n_words = words.iter().take_while(|word| word.parse::<f64>().is_err()).count();
    let (kind, numbers) = words.split_at(n_words);
    let numbers: Option<Vec<f64>> =
        numbers.iter().map(|word| word.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let numbers = numbers.ok_or_else(|| error("the numbers must be finite and stand at the end"))?;
    match kind {
        ["quaternion", order] => {
            let q: [f64; 4] = numbers.try_into().map_err(|_| error("a quaternion has four numbers"))?;
            match *order {
                "xyzw" => from_quaternion(q),
                "wxyz" => from_quaternion([q[1], q[2], q[3], q[0]]),
                _ => Err(error("the order of a quaternion is xyzw or wxyz")),
            }
        }
        ["quaternion"] => Err(error("the order of a quaternion must be named: xyzw or wxyz")),
        ["matrix"] => {
            let m: [f64; 9] = numbers.try_into().map_err(|_| error("a matrix has nine numbers"))?;
            from_matrix(&Matrix3::from_row_slice(&m))
        }
        ["rpy", unit] => {
            let angles = angles(&numbers, unit).ok_or_else(|| error("rpy has deg or rad and three numbers"))?;
            euler("xyz", false, angles).ok_or_else(|| error("the order has three of x, y, z"))
        }
        ["euler", sense, order, unit] => {
            let is_intrinsic = match *sense {
                "intrinsic" => true,
                "extrinsic" => false,
                _ => return Err(error("Euler angles are intrinsic (moving axes) or extrinsic (fixed axes)")),
            };
            let angles =
                angles(&numbers, unit).ok_or_else(|| error("Euler angles have deg or rad and three numbers"))?;
            euler(order, is_intrinsic, angles)
                .ok_or_else(|| error("the order is three of x, y, z, no two neighbors the same"))
        }
        ["euler", ..] => Err(error("Euler angles need intrinsic or extrinsic, an order such as zyx, and deg or rad")),
        _ => Err(error("unknown form")),
    }
}

fn angles(numbers: &[f64], unit: &str) -> Option<[f64; 3]> {
    let scale = match unit {
        "deg" => PI / 180.0,
        "rad" => 1.0,
        _ => return None,
    };
    let numbers: [f64; 3] = numbers.try_into().ok()?;
    Some(numbers.map(|value| value * scale))
}

/// Consecutive rotations about the axes of `order`, rad: about the rotated axes (intrinsic), or about the axes of the
/// fixed frame (extrinsic). `None` unless the order has three of x, y, z.
pub fn euler(order: &str, is_intrinsic: bool, angles: [f64; 3]) -> Option<UnitQuaternion<f64>> {
    let axis = |letter: char| match letter {
        'x' => Some(Vector3::x_axis()),
        'y' => Some(Vector3::y_axis()),
        'z' => Some(Vector3::z_axis()),
        _ => None,
    };
    let axes: Vec<_> = order.chars().map(axis).collect::<Option<_>>()?;
    if axes.len() != 3 || axes[0] == axes[1] || axes[1] == axes[2] {
        return None;
    }
    let [a, b, c] = [0, 1, 2].map(|i| UnitQuaternion::from_axis_angle(&axes[i], angles[i]));
    Some(if is_intrinsic { a * b * c } else { c * b * a })
}

/// Converts a quaternion x y z w.
pub fn from_quaternion([x, y, z, w]: [f64; 4]) -> Result<UnitQuaternion<f64>, RotationError> {
    let quaternion = Quaternion::new(w, x, y, z);
    let norm = quaternion.norm();
    if (norm - 1.0).abs() < TOLERANCE {
        Ok(UnitQuaternion::from_quaternion(quaternion))
    } else {
        Err(RotationError::Norm { norm })
    }
}

/// Converts a matrix whose columns are the axes of the sensor. Rounding is removed.
pub fn from_matrix(matrix: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, RotationError> {
    let off = (matrix * matrix.transpose() - Matrix3::identity()).abs().max();
    if off.is_nan() || off >= TOLERANCE {
        return Err(RotationError::Matrix { off });
    }
    let determinant = matrix.determinant();
    if determinant < 0.0 {
        return Err(RotationError::Mirrored { determinant });
    }
    // The nearest rotation.
    let svd = matrix.svd(true, true);
    let nearest = match (svd.u, svd.v_t) {
        (Some(u), Some(v_t)) => u * v_t,
        _ => *matrix,
    };
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(nearest)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angle(a: &str, b: &str) -> f64 {
        let [a, b] = [a, b].map(|text| parse(text).expect("a rotation"));
        a.angle_to(&b)
    }

    #[test]
    fn forms_of_one_rotation_are_equal() {
        // A quarter turn to the left.
        let quarter = "quaternion xyzw 0,0,0.70710678,0.70710678";
        for same in [
            "quaternion wxyz 0.70710678 0 0 0.70710678",
            "matrix 0,-1,0, 1,0,0, 0,0,1",
            "rpy deg 0,0,90",
            "euler intrinsic zyx deg 90,0,0",
            "euler extrinsic xyz rad 0, 0, 1.570796327",
        ] {
            assert!(angle(quarter, same) < 1e-6, "{same}");
        }
    }

    #[test]
    fn order_and_sense_of_euler_angles_matter() {
        // Intrinsic zyx is extrinsic xyz with the angles in reverse order.
        assert!(angle("euler intrinsic zyx deg 30,20,10", "euler extrinsic xyz deg 10,20,30") < 1e-9);
        assert!(angle("euler intrinsic zyx deg 30,20,10", "rpy deg 10,20,30") < 1e-9);
        assert!(angle("euler intrinsic xyz deg 10,20,30", "euler extrinsic xyz deg 10,20,30") > 0.05);
        let point = parse("euler intrinsic zyx deg 90,90,0").expect("a rotation") * Vector3::x();
        // Turned to the left, then down.
        assert!((point - -Vector3::z()).norm() < 1e-9, "{point}");
        let matrix = parse("rpy deg 10,20,30").expect("a rotation").to_rotation_matrix();
        let found = from_matrix(matrix.matrix()).expect("a rotation");
        assert!(found.angle_to(&parse("rpy deg 10,20,30").expect("a rotation")) < 1e-9);
    }

    #[test]
    fn mirrored_and_skewed_matrices_are_refused() {
        let error = |text: &str| parse(text).expect_err("refused").to_string();
        assert!(error("matrix 1,0,0, 0,-1,0, 0,0,1").contains("mirrors one axis"));
        assert!(error("matrix 1,0.1,0, 0,1,0, 0,0,1").contains("must be below 0.001"));
        assert!(error("quaternion xyzw 0,0,0,0.9").starts_with("the quaternion has length 0.9000; must be 1"));
        assert!(from_matrix(&(Matrix3::identity() * f64::NAN)).is_err());
    }

    #[test]
    fn ambiguous_forms_are_refused_with_the_missing_word() {
        let error = |text: &str| parse(text).expect_err("refused").to_string();
        assert!(error("quaternion 0,0,0,1").contains("must be named: xyzw or wxyz"));
        assert!(error("euler zyx deg 0,1.5,90").contains("need intrinsic or extrinsic"));
        assert!(error("euler intrinsic zzx deg 0,1,2").contains("no two neighbors the same"));
        assert!(error("euler intrinsic zyx 0,1,2").contains("deg or rad"));
        assert!(error("rpy deg 1,2").contains("three numbers"));
        assert!(error("rpy deg 1,2,inf").contains("finite"));
        assert!(error("").contains("unknown form"));
    }
}
