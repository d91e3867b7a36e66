//! Rings of clouds whose points have no ring numbers.

use formats::cloud::CloudPoint;
use lidar::{Directions, Lidar, Model, OrderedRings, rings_by_order, velodyne};

/// The ring of each row, 0 = lowest; 0 for sensors without fixed beams. Rows that are stored ring by ring get the rings of their order,
/// which needs no nominal elevations: a unit differs from them by up to half of the spacing of its beams. Other rows get the nearest
/// beam of the model by elevation (for the HDL-64E: the beams of the KITTI device).
pub(super) fn cloud_rings<T>(rows: &[T], point: impl Fn(&T) -> CloudPoint, lidar: &Lidar) -> Vec<u8> {
    let beams = NominalBeams::new(lidar);
    if beams.n() == 0 {
        return vec![0; rows.len()];
    }
    let position = |row: &T| {
        let CloudPoint { x, y, z, .. } = point(row);
        [x, y, z]
    };
    let ordered = rings_by_order(&Directions::new(rows, position)).filter(|ordered| ordered.n <= beams.n());
    let nearest = |row: &T| beams.nearest(&point(row));
    match ordered {
        Some(ordered) if ordered.n == beams.n() => ordered.by_point,
        Some(ordered) => numbered(&ordered, beams.n(), |row| nearest(&rows[row])),
        None => rows.iter().map(nearest).collect(),
    }
}

/// Rings by order, numbered as the beams of the model: rings without returns are missing in the order. `nearest` gives the nearest
/// beam of a row.
fn numbered(ordered: &OrderedRings, n_beams: usize, nearest: impl Fn(usize) -> u8) -> Vec<u8> {
    let mut nearest_beams = vec![Vec::new(); ordered.n];
    for (row, ring) in ordered.by_point.iter().enumerate().step_by(ROWS_PER_SAMPLE) {
        nearest_beams[usize::from(*ring)].push(nearest(row));
    }
    let medians: Vec<Option<u8>> = nearest_beams
        .into_iter()
        .map(|mut beams| {
            beams.sort_unstable();
            beams.get(beams.len() / 2).copied()
        })
        .collect();
    let beams = rising_beams(&medians, n_beams);
    ordered.by_point.iter().map(|ring| beams[usize::from(*ring)]).collect()
}

/// One row of a cloud in this number determines the beams of its rings.
const ROWS_PER_SAMPLE: usize = 8;

/// The beam of each ring: rising from ring to ring, with the least sum of distances from the rings' medians.
fn rising_beams(medians: &[Option<u8>], n_beams: usize) -> Vec<u8> {
    let n_free = n_beams - medians.len();
    // Least cost of the rings so far if the last one is `free` beams above its number, and the `free` of the ring below it.
    let mut least = vec![0_usize; n_free + 1];
    let mut below = Vec::with_capacity(medians.len());
    for (ring, median) in medians.iter().enumerate() {
        let mut best = 0;
        let from: Vec<usize> = (0..=n_free)
            .map(|free| {
                best = if least[free] < least[best] { free } else { best };
                best
            })
            .collect();
        let cost = |free: usize| median.map_or(0, |median| usize::from(median).abs_diff(ring + free));
        least = (0..=n_free).map(|free| least[from[free]] + cost(free)).collect();
        below.push(from);
    }
    let mut free = (0..=n_free).min_by_key(|free| least[*free]).unwrap_or(0);
    let mut beams = vec![0; medians.len()];
    for (ring, from) in below.iter().enumerate().rev() {
        beams[ring] = (ring + free) as u8;
        free = from[free];
    }
    beams
}

/// Elevations of the lower 32 beams of the HDL-64E of KITTI, lowest first, deg: medians over sweeps of its raw recordings, whose
/// points are ordered by beam. The elevation of a beam varies by less than 0.03 deg over a revolution.
#[rustfmt::skip]
const KITTI_LOWER_DEG: [f32; 32] = [
    -24.99, -24.49, -23.95, -23.3, -22.83, -22.41, -21.91, -21.29, -20.75, -20.19, -19.7,
    -19.28, -18.76, -18.28, -17.69, -17.14, -16.5, -16.13, -15.61, -15.14, -14.54, -13.99,
    -13.43, -12.99, -12.51, -12.06, -11.54, -10.9, -10.41, -10.0, -9.51, -8.96,
];
/// Elevations of the upper 32 beams, see [`KITTI_LOWER_DEG`].
#[rustfmt::skip]
const KITTI_UPPER_DEG: [f32; 32] = [
    -8.72, -8.32, -8.07, -7.69, -7.29, -7.0, -6.68, -6.33, -5.96, -5.61, -5.25,
    -4.91, -4.58, -4.21, -3.93, -3.53, -3.22, -2.86, -2.53, -2.19, -1.81, -1.47,
    -1.18, -0.78, -0.43, -0.06, 0.21, 0.61, 0.9, 1.34, 1.61, 1.98,
];
/// Height of the lower lasers above the origin of the points, m. At 5 m range this is two degrees.
const KITTI_LOWER_UP_M: f32 = 0.115;
/// Height of the upper lasers above the origin of the points, m.
const KITTI_UPPER_UP_M: f32 = 0.2;

/// Beams of one height, sorted by elevation.
struct Bank {
    up_m: f32,
    elevations: Vec<f32>,
}

/// All beams of a model, the highest bank first.
struct NominalBeams(Vec<Bank>);

impl NominalBeams {
    fn new(lidar: &Lidar) -> Self {
        let bank = |up_m: f32, degrees: &[f32]| {
            let mut elevations: Vec<f32> = degrees.iter().map(|degrees| degrees.to_radians()).collect();
            elevations.sort_by(f32::total_cmp);
            Bank { up_m, elevations }
        };
        if lidar.model() == Model::Velodyne(velodyne::Model::Hdl64e) {
            return Self(vec![bank(KITTI_UPPER_UP_M, &KITTI_UPPER_DEG), bank(KITTI_LOWER_UP_M, &KITTI_LOWER_DEG)]);
        }
        let degrees: Vec<f32> = lidar.elevations_deg().iter().map(|degrees| *degrees as f32).collect();
        // With fewer than two beams, points have no rings.
        Self(if degrees.len() < 2 { Vec::new() } else { vec![bank(0.0, &degrees)] })
    }

    /// Number of beams.
    fn n(&self) -> usize {
        self.0.iter().map(|bank| bank.elevations.len()).sum()
    }

    /// The beam with the nearest elevation, 0 = lowest.
    fn nearest(&self, p: &CloudPoint) -> u8 {
        let across_m = p.x.hypot(p.y);
        let mut n_below = self.n();
        let mut ring = 0;
        for bank in &self.0 {
            n_below -= bank.elevations.len();
            let elevation = (p.z - bank.up_m).atan2(across_m);
            ring = n_below + bank.nearest(elevation);
            if bank.is_above_lower_end(elevation) {
                break;
            }
        }
        ring as u8
    }
}

impl Bank {
    /// Whether the elevation is above the lower end of the bank.
    fn is_above_lower_end(&self, elevation: f32) -> bool {
        let half_step = 0.5 * (self.elevations[1] - self.elevations[0]);
        elevation > self.elevations[0] - half_step
    }

    /// Index of the nearest beam.
    fn nearest(&self, elevation: f32) -> usize {
        let beams = &self.elevations;
        let above = beams.partition_point(|e| *e < elevation).clamp(1, beams.len() - 1);
        let lower_is_nearer = elevation - beams[above - 1] < beams[above] - elevation;
        if lower_is_nearer { above - 1 } else { above }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lidar::velodyne::Model as Velodyne;

    /// A cloud with its true rings.
    #[derive(Default)]
    struct Street {
        points: Vec<CloudPoint>,
        rings: Vec<u8>,
    }

    impl Street {
        /// Returns the cloud in an order that shows no rings.
        fn shuffled(&self) -> Self {
            let order: Vec<usize> = (0..self.points.len()).map(|at| at * 7_919 % self.points.len()).collect();
            Self {
                points: order.iter().map(|at| self.points[*at]).collect(),
                rings: order.iter().map(|at| self.rings[*at]).collect(),
            }
        }

        fn share_right(&self) -> f64 {
            let found = cloud_rings(&self.points, |p| *p, &Velodyne::Hdl64e.into());
            let n_right = found.iter().zip(&self.rings).filter(|(found, truth)| found == truth).count();
            n_right as f64 / self.rings.len() as f64
        }
    }

    /// A street ring by ring, the highest first, by the beams of an HDL-64E whose elevations are off by `error_deg`.
    fn street(error_deg: f32, has_returns: impl Fn(u8) -> bool) -> Street {
        let mut street = Street::default();
        for ring in (0..64_u8).rev().filter(|ring| has_returns(*ring)) {
            let of_bank = usize::from(ring % 32);
            let [elevation_deg, up_m] = if ring < 32 {
                [KITTI_LOWER_DEG[of_bank], KITTI_LOWER_UP_M]
            } else {
                [KITTI_UPPER_DEG[of_bank], KITTI_UPPER_UP_M]
            };
            let slope = (elevation_deg + error_deg).to_radians().tan();
            for column in 0..900_u16 {
                let azimuth = f32::from(column) / 900.0 * std::f32::consts::TAU;
                let range_m = 12.0 + 6.0 * (3.0 * azimuth).sin();
                let [x, y] = [range_m * azimuth.cos(), range_m * azimuth.sin()];
                street.points.push(CloudPoint { x, y, z: range_m * slope + up_m, intensity: 0.5 });
                street.rings.push(ring);
            }
        }
        street
    }

    #[test]
    fn rings_of_a_unit_with_other_elevations_follow_the_order() {
        let street = street(0.3, |_| true);
        let share = street.share_right();
        assert!(share > 0.98, "{share}");
        let share = street.shuffled().share_right();
        assert!(share < 0.7, "the nearest beams: {share}");
    }

    #[test]
    fn rings_without_returns_leave_the_numbers_of_the_others() {
        for missing in [0..1, 60..64, 20..23, 0..9] {
            let share = street(0.1, |ring| !missing.contains(&ring)).share_right();
            assert!(share > 0.97, "without {missing:?}: {share}");
        }
    }
}
