//! Compares the path of the fixes with the path of the odometry: their size, and fixes whose coordinates were written in
//! radians or with latitude and longitude exchanged. Such positions are valid positions at another place of the Earth.

use crate::median::median;
use crate::{PointPair, align_odometry};
use doubts::{Doubt, FixReading};
use geometry::{Geodetic, Point3};

/// Fixes that are compared, evenly spaced.
const MAX_FIXES: usize = 60;
/// With fewer fixes, nothing is said.
const MIN_FIXES: usize = 6;
/// Shorter paths are not compared, m: the errors of fixes are a large part of them. Median of the distances in the longer
/// path.
const MIN_DISTANCE_M: f64 = 20.0;
/// Quotients of distances between fixes and by odometry that good drives have. Parts of 80 s of KITTI `2011_10_03_0027`
/// with real fixes have 0.99 to 1.01; a SLAM path of 6.5 km and its positions have 1.00 to 1.01.
const MIN_RATIO: f64 = 0.8;
const MAX_RATIO: f64 = 1.25;
/// Paths that fit better than this have the right shape, m, median.
const GOOD_M: f64 = 3.0;
/// A misreading must fit this much better than the path as stated.
const MIN_GAIN: f64 = 4.0;

/// Fixes farther from the origin of the world do not belong to it, m: a plane that touches the Earth there is 800 m above
/// them.
const MAX_FROM_ORIGIN_M: f64 = 100_000.0;

/// How coordinates may have been written.
#[derive(Clone, Copy)]
enum Misreading {
    Exchanged,
    Radians,
}

impl Misreading {
    const ALL: [Self; 2] = [Self::Radians, Self::Exchanged];

    const fn text(self) -> &'static str {
        match self {
            Self::Exchanged => "with latitude and longitude exchanged",
            Self::Radians => "in radians",
        }
    }

    /// The offsets to east and north, if the coordinates at the origin were written so; `None` if they cannot be.
    fn corrected(self, origin: &Geodetic, [east, north]: [f64; 2]) -> Option<[f64; 2]> {
        let (latitude, longitude) = (origin.latitude_deg, origin.longitude_deg);
        let cos = |degrees: f64| degrees.to_radians().cos();
        match self {
            // East is longitude times the cosine of the latitude.
            Self::Exchanged => (longitude.abs() < 89.0).then(|| [cos(longitude) * north, east / cos(latitude)]),
            Self::Radians => {
                let true_latitude = latitude.to_degrees();
                let factor = 1_f64.to_degrees();
                (true_latitude.abs() < 89.0 && longitude.to_degrees().abs() <= 180.0)
                    .then(|| [cos(true_latitude) / cos(latitude) * factor * east, factor * north])
            }
        }
    }
}

/// The doubt about fixes whose path has another size or shape than the odometry. `pairs`: positions of the antenna by the
/// odometry and by the fixes, relative to `origin`.
pub(crate) fn shape_doubt(pairs: &[PointPair], origin: Option<&Geodetic>) -> Option<Doubt> {
    let pairs: Vec<PointPair> = pairs.iter().step_by(pairs.len().div_ceil(MAX_FIXES).max(1)).copied().collect();
    if pairs.len() < MIN_FIXES {
        return None;
    }
    let far_m = median(pairs.iter().map(|pair| pair.p_in_world.xy().coords.norm()))?;
    if far_m > MAX_FROM_ORIGIN_M {
        return Some(Doubt::FarOrigin { far_m, limit_m: MAX_FROM_ORIGIN_M });
    }
    let misfit_m = misfit_of(&pairs)?;
    let ratio = ratio_of(&pairs)?;
    let has_size = (MIN_RATIO..=MAX_RATIO).contains(&ratio);
    if has_size && misfit_m <= GOOD_M {
        return None;
    }
    let reading = Misreading::ALL.into_iter().find_map(|misreading| {
        let corrected = corrected(&pairs, misreading, origin?)?;
        let read_m = misfit_of(&corrected)?;
        let is_better = read_m * MIN_GAIN < misfit_m && (MIN_RATIO..=MAX_RATIO).contains(&ratio_of(&corrected)?);
        is_better.then(|| FixReading { text: misreading.text(), misfit_m: read_m })
    });
    (reading.is_some() || !has_size).then_some(Doubt::FixShape {
        misfit_m,
        ratio,
        usual: [MIN_RATIO, MAX_RATIO],
        reading,
    })
}

/// The pairs with the positions that the fixes have if they were written so.
fn corrected(pairs: &[PointPair], misreading: Misreading, origin: &Geodetic) -> Option<Vec<PointPair>> {
    let corrected = |pair: &PointPair| {
        let Point3 { coords } = pair.p_in_world;
        let [east, north] = misreading.corrected(origin, [coords.x, coords.y])?;
        Some(PointPair { p_in_world: Point3::new(east, north, coords.z), ..*pair })
    };
    pairs.iter().map(corrected).collect()
}

/// Median horizontal distance of the fixes from the aligned odometry, m.
fn misfit_of(pairs: &[PointPair]) -> Option<f64> {
    let alignment = align_odometry(pairs, None)?;
    let distance = |pair: &PointPair| (alignment.world_from_odom * pair.p_in_odom - pair.p_in_world).xy().norm();
    median(pairs.iter().map(distance))
}

/// Quotient of distances between fixes and by odometry, medians over the longer half of the distances by odometry. `None`
/// if both are short.
fn ratio_of(pairs: &[PointPair]) -> Option<f64> {
    let mut distances: Vec<[f64; 2]> = Vec::new();
    for (index, a) in pairs.iter().enumerate() {
        let between =
            |b: &PointPair| [(a.p_in_odom - b.p_in_odom).xy().norm(), (a.p_in_world - b.p_in_world).xy().norm()];
        distances.extend(pairs[index + 1..].iter().map(between));
    }
    distances.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let longer = distances.split_off(distances.len() / 2);
    let [odom_m, world_m] = [0, 1].map(|which| median(longer.iter().map(|distance| distance[which])));
    let (odom_m, world_m) = (odom_m?, world_m?);
    (odom_m.max(world_m) >= MIN_DISTANCE_M).then(|| world_m / odom_m.max(1e-3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Isometry3, LocalFrame, Vector3};

    /// A drive of 240 m through a bend, and its fixes: `written` are latitude and longitude as the receiver writes them.
    fn pairs(error_m: f64, written: impl Fn([f64; 2]) -> [f64; 2]) -> (Vec<PointPair>, Geodetic) {
        let frame = LocalFrame::new(Geodetic::new(48.85, 2.35, 90.0).expect("is valid"));
        let world_from_odom = Isometry3::new(Vector3::new(3.0, 4.0, 0.0), Vector3::z() * 1.1);
        let position = |k: usize| {
            let angle = k as f64 * 0.03;
            Point3::new(80.0 * angle.sin(), 80.0 * (1.0 - angle.cos()), 0.0)
        };
        let geodetic = |k: usize| {
            let error = Vector3::new((k as f64 * 2.4).sin(), (k as f64 * 1.7).cos(), 0.0) * error_m;
            let place = frame.geodetic_from_world(&(world_from_odom * position(k) + error));
            let [latitude, longitude] = written([place.latitude_deg, place.longitude_deg]);
            Geodetic::new(latitude, longitude, place.altitude_m).expect("is valid")
        };
        let origin = geodetic(0);
        let world = LocalFrame::new(origin);
        let pair = |k: usize| PointPair {
            p_in_odom: position(k),
            p_in_world: world.world_from_geodetic(&geodetic(k)),
            weight: 1.0,
        };
        ((0..100).map(pair).collect(), origin)
    }

    /// The reading that the doubt names; empty without a doubt.
    fn reading(error_m: f64, written: impl Fn([f64; 2]) -> [f64; 2]) -> &'static str {
        let (pairs, origin) = pairs(error_m, written);
        match shape_doubt(&pairs, Some(&origin)) {
            None => "",
            Some(Doubt::FixShape { reading, .. }) => reading.map_or("unknown", |reading| reading.text),
            Some(other) => panic!("{other:?}"),
        }
    }

    #[test]
    fn readings_are_distinguished_by_the_shape_of_the_path() {
        for error_m in [0.0, 2.0] {
            assert_eq!(reading(error_m, |place| place), "", "{error_m}");
            let radians = reading(error_m, |place| place.map(f64::to_radians));
            assert_eq!(radians, "in radians", "{error_m}");
            let exchanged = reading(error_m, |[latitude, longitude]| [longitude, latitude]);
            assert_eq!(exchanged, "with latitude and longitude exchanged", "{error_m}");
            let half = reading(error_m, |[latitude, longitude]| [24.0 + latitude / 2.0, longitude / 2.0]);
            assert_eq!(half, "unknown", "{error_m}");
        }
        // Wrong fixes of a good receiver, and large errors, do not change the size of the path.
        assert_eq!(reading(6.0, |place| place), "");
    }

    #[test]
    fn short_paths_and_few_fixes_are_not_compared() {
        let (pairs, origin) = pairs(1.0, |place| place.map(f64::to_radians));
        assert!(shape_doubt(&pairs[..5], Some(&origin)).is_none());
        assert!(shape_doubt(&pairs[..8], Some(&origin)).is_none(), "the path has 17 m");
        assert!(shape_doubt(&[], None).is_none());
    }

    /// The origin of drive.toml is right, and the fixes are not, or the other way round.
    #[test]
    fn fixes_far_from_the_origin_of_the_world_are_a_doubt() {
        let (mut pairs, origin) = pairs(1.0, |place| place);
        for pair in &mut pairs {
            pair.p_in_world.x += 3_000_000.0;
        }
        let doubt = shape_doubt(&pairs, Some(&origin));
        assert!(matches!(doubt, Some(Doubt::FarOrigin { far_m, .. }) if far_m > 2_900_000.0), "{doubt:?}");
    }
}
