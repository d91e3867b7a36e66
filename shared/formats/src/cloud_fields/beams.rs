//! Rings: drivers count the beams from the lowest or the highest, or in firing order; a drive counts from the lowest.

use std::collections::BTreeMap;

/// Minimum number of points that determine the elevation of a beam.
const MIN_POINTS: u32 = 10;
/// Minimum correlation of number and elevation for a driver that counts beams by elevation.
const ORDERED: f64 = 0.9;
/// Maximum scatter of the elevations of the points of one beam, rms: beams leave a sensor up to 0.2 m off its origin. The
/// prisms of a Livox turn each beam through 0.3 rad rms.
const MAX_SCATTER_RAD: f64 = 0.05;
/// Numbers of beams of usual sensors.
const BEAMS: [u16; 7] = [16, 32, 40, 64, 80, 96, 128];

/// Elevations of the beams of some clouds.
#[derive(Debug, Default)]
pub struct Elevations {
    beams: BTreeMap<u16, Beam>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Beam {
    n: u32,
    sum: f64,
    sum_of_squares: f64,
}

/// The ring of each beam of a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rings {
    /// Ring by number of the beam; `None` for a beam that was not seen.
    of_beam: Vec<Option<u8>>,
    /// Order of the beam numbers, for the report.
    pub order: &'static str,
}

impl Rings {
    /// The ring of a beam.
    pub fn get(&self, beam: u16) -> Option<u8> {
        self.of_beam.get(usize::from(beam)).copied().flatten()
    }

    /// Whether each beam has its own number as its ring.
    pub(super) fn is_identity(&self) -> bool {
        self.of_beam.iter().enumerate().all(|(beam, ring)| *ring == u8::try_from(beam).ok())
    }

    /// Number of beams.
    pub fn n_rings(&self) -> usize {
        self.of_beam.len()
    }
}

impl Elevations {
    /// Adds a point of a beam.
    pub fn add(&mut self, ring: u16, position: [f32; 3]) {
        let [x, y, z] = position.map(f64::from);
        let elevation = z.atan2(x.hypot(y));
        let beam = self.beams.entry(ring).or_default();
        beam.n += 1;
        beam.sum += elevation;
        beam.sum_of_squares += elevation * elevation;
    }

    /// The rings. `n_beams`: number of beams if known. `n_rows`: rows of the clouds, often one per beam. `None` if the
    /// numbers do not stand for fixed elevations, or if they exceed `n_beams` or 256.
    pub fn rings(&self, n_beams: Option<u16>, n_rows: u32) -> Option<Rings> {
        let (&last, _) = self.beams.last_key_value()?;
        let of_rows = u16::try_from(n_rows).ok();
        let guesses = of_rows.into_iter().chain(BEAMS).chain([last.saturating_add(1)]);
        let n_beams = n_beams.or_else(|| guesses.into_iter().find(|n| *n > last))?;
        if last >= n_beams || n_beams > 256 {
            return None;
        }
        let seen: Vec<(u16, f64)> = self
            .beams
            .iter()
            .filter(|(_, beam)| beam.n >= MIN_POINTS)
            .map(|(ring, beam)| (*ring, beam.mean()))
            .collect();
        let scatter = self.beams.values().map(Beam::squares).sum::<f64>()
            / self.beams.values().map(|beam| f64::from(beam.n)).sum::<f64>();
        if seen.len() < 2 || scatter.sqrt() > MAX_SCATTER_RAD {
            return None;
        }
        let correlation = correlation(&seen);
        let all = 0..n_beams;
        let (of_beam, order): (Vec<Option<u8>>, _) = if correlation > ORDERED {
            (all.map(|beam| Some(beam as u8)).collect(), "from the lowest")
        } else if correlation < -ORDERED {
            (all.map(|beam| Some((n_beams - 1 - beam) as u8)).collect(), "from the highest")
        } else {
            let rank = |elevation: f64| seen.iter().filter(|(_, other)| *other < elevation).count() as u8;
            let mean = |beam: u16| seen.iter().find(|(ring, _)| *ring == beam).map(|(_, mean)| *mean);
            (all.map(|beam| mean(beam).map(rank)).collect(), "not along the elevation")
        };
        // If the numbers are not ordered, the rank of a beam is known only if all beams are known.
        of_beam.iter().all(Option::is_some).then_some(Rings { of_beam, order })
    }
}

impl Beam {
    fn mean(&self) -> f64 {
        self.sum / f64::from(self.n)
    }

    /// Sum of the squared distances to the mean.
    fn squares(&self) -> f64 {
        (self.sum_of_squares - self.sum * self.mean()).max(0.0)
    }
}

/// Pearson's correlation of number and elevation.
fn correlation(beams: &[(u16, f64)]) -> f64 {
    let n = beams.len() as f64;
    let mean_x = beams.iter().map(|(ring, _)| f64::from(*ring)).sum::<f64>() / n;
    let mean_y = beams.iter().map(|(_, elevation)| elevation).sum::<f64>() / n;
    let mut xx = 0.0;
    let mut yy = 0.0;
    let mut xy = 0.0;
    for (ring, elevation) in beams {
        let x = f64::from(*ring) - mean_x;
        let y = elevation - mean_y;
        xx += x * x;
        yy += y * y;
        xy += x * y;
    }
    xy / (xx * yy).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of beams with these elevations, deg.
    fn elevations_from_beams(elevations_deg: &[f64]) -> Elevations {
        let mut elevations = Elevations::default();
        for (beam, degrees) in elevations_deg.iter().enumerate() {
            for i in 0..20 {
                let range_m = 5.0 + f64::from(i);
                let z = (range_m * degrees.to_radians().tan()) as f32;
                let position = [range_m as f32, 0.0, z];
                elevations.add(beam as u16, position);
            }
        }
        elevations
    }

    #[test]
    fn drivers_that_count_from_either_end_get_rings_from_the_lowest() {
        // The highest of 16 beams has no points.
        let rising: Vec<f64> = (0..15).map(|beam| f64::from(beam) * 2.0 - 15.0).collect();
        let rings = elevations_from_beams(&rising).rings(None, 1).expect("rings");
        assert_eq!(
            (rings.get(0), rings.get(15), rings.get(16), rings.order),
            (Some(0), Some(15), None, "from the lowest")
        );
        assert_eq!(elevations_from_beams(&rising).rings(None, 64).expect("rings").n_rings(), 64);
        let falling: Vec<f64> = rising.iter().map(|degrees| -degrees).collect();
        let rings = elevations_from_beams(&falling).rings(None, 1).expect("rings");
        assert_eq!((rings.get(0), rings.get(14), rings.order), (Some(15), Some(1), "from the highest"));
    }

    #[test]
    fn numbers_in_firing_order_get_ranks_if_all_beams_are_seen() {
        // A VLP-16 fires -15, 1, -13, 3, ...
        let firing: Vec<f64> = (0..16).map(|i| f64::from(i / 2) * 2.0 + if i % 2 == 0 { -15.0 } else { 1.0 }).collect();
        let rings = elevations_from_beams(&firing).rings(None, 1).expect("rings");
        assert_eq!((0..4).map(|beam| rings.get(beam)).collect::<Vec<_>>(), [Some(0), Some(8), Some(1), Some(9)]);
        assert_eq!(elevations_from_beams(&firing[..13]).rings(None, 1), None);
    }

    #[test]
    fn numbers_without_fixed_elevation_are_no_rings() {
        let mut elevations = elevations_from_beams(&[-5.0, 0.0, 5.0]);
        for i in 0..1000_u16 {
            let position = [5.0, 0.0, f32::from(i % 100) * 0.1 - 5.0];
            elevations.add(i % 3, position);
        }
        assert_eq!(elevations.rings(None, 1), None);
        assert_eq!(elevations_from_beams(&[1.0; 300]).rings(None, 1), None);
        assert_eq!(elevations_from_beams(&[1.0, 2.0, 3.0]).rings(Some(2), 1), None);
        assert_eq!(Elevations::default().rings(None, 1), None);
    }
}
