//! An invented scanner: the ring and the angles of a point as seen from a position. Third-party clouds keep neither the
//! rings nor the orientation of their scanner, but range images need both.

use messages::{POINT_INCIDENCE_UNKNOWN, SubmapPoint};

/// Rings of an HDL-32E, and wider ones below and above, because registered clouds have points in all directions.
pub(super) const N_RINGS: u8 = 64;
/// Rings below the rings of an HDL-32E.
const N_BELOW: u8 = 16;
/// Rings of an HDL-32E.
const N_FINE: u8 = 32;
/// Elevation of the lowest ring of an HDL-32E, degrees.
const LOWEST_DEG: f64 = -30.67;
/// Angle between the rings of an HDL-32E, degrees.
const STEP_DEG: f64 = 4.0 / 3.0;
/// Borders of the lowest and highest ring of an HDL-32E, degrees.
const FINE_DEG: [f64; 2] = [LOWEST_DEG - 0.5 * STEP_DEG, LOWEST_DEG + (N_FINE as f64 - 0.5) * STEP_DEG];

/// Elevation of a ray, degrees.
fn elevation_deg([x, y, z]: [f64; 3]) -> f64 {
    z.atan2(x.hypot(y)).to_degrees()
}

fn ring(elevation_deg: f64) -> u8 {
    let [lowest, highest] = FINE_DEG;
    let (first, n, begin, end) = if elevation_deg < lowest {
        (0, N_BELOW, -90.0, lowest)
    } else if elevation_deg < highest {
        (N_BELOW, N_FINE, lowest, highest)
    } else {
        (N_BELOW + N_FINE, N_RINGS - N_BELOW - N_FINE, highest, 90.0)
    };
    let step = ((elevation_deg - begin) / (end - begin) * f64::from(n)) as u8;
    first + step.min(n - 1)
}

/// Whether a ray is between the lowest and the highest ring of an HDL-32E.
pub(super) fn is_fine(ray: [f64; 3]) -> bool {
    (FINE_DEG[0]..FINE_DEG[1]).contains(&elevation_deg(ray))
}

/// A point of a submap without coordinates and sweep. `ray` is the vector from the scanner to the point.
pub(super) fn row(ray: [f64; 3], intensity: f32, cosine: f32) -> SubmapPoint {
    let elevation_deg = elevation_deg(ray);
    // Encoder angles increase clockwise seen from above.
    let azimuth_deg = (-ray[1]).atan2(ray[0]).to_degrees().rem_euclid(360.0);
    SubmapPoint {
        azimuth: ((azimuth_deg * 100.0).round() as u32 % 36_000) as u16,
        elevation: (elevation_deg * 100.0).round() as i16,
        ring: ring(elevation_deg),
        intensity: intensity.round().clamp(0.0, 255.0) as u8,
        incidence: if (0.0..=1.0).contains(&cosine) { (cosine * 254.0).round() as u8 } else { POINT_INCIDENCE_UNKNOWN },
        ..SubmapPoint::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_have_the_ring_and_angles_of_their_direction() {
        let ahead = row([10.0, 0.0, 0.0], 12.4, 0.5);
        assert_eq!((ahead.azimuth, ahead.elevation, ahead.ring, ahead.intensity, ahead.incidence), (0, 0, 39, 12, 127));
        let right = row([0.0, -10.0, -5.9], 300.0, f32::NAN);
        assert_eq!((right.azimuth, right.ring, right.intensity, right.incidence), (9_000, 16, 255, 255));
        for (degrees, expected) in [(-90.0, 0), (-31.4, 15), (-30.67, 16), (10.66, 47), (11.4, 48), (90.0, 63)] {
            assert_eq!(ring(degrees), expected, "{degrees}");
        }
        assert!(is_fine([1.0, 0.0, -0.5]) && !is_fine([1.0, 0.0, 0.5]));
    }
}
