//! Finds the true label of each point of a cloud.

use anyhow::ensure;
use drive::{Drive, LabelReader, LabelledSweep, NoLabel, Shot, find_label};
use formats::ply::Vertices;
use rayon::prelude::*;
use scores::PointLabel;

/// The label of a point, or the reason why it is missing.
pub type Labelled = Result<PointLabel, NoLabel>;

/// The labels of the sweeps around a cloud. Memory: the labels of the sweeps of one cloud.
pub struct TruePoints {
    drive: Drive,
    reader: LabelReader,
    /// Sorted by time, without gaps.
    sweeps: Vec<LabelledSweep>,
    /// End of the last sweep that was removed, ns.
    forgotten: Option<i64>,
    /// Stamps of the first and of the latest sweep that were read, ns.
    read: Option<[i64; 2]>,
    /// Numbers of sweeps that were read, and of sweeps without labels.
    n_sweeps: u64,
    n_unlabeled: u64,
}

impl TruePoints {
    /// An error if the drive has no labels.
    pub fn open(drive: Drive) -> anyhow::Result<Self> {
        let reader = reader(&drive)?;
        let mut points =
            Self { drive, reader, sweeps: Vec::new(), forgotten: None, read: None, n_sweeps: 0, n_unlabeled: 0 };
        points.read_sweep()?;
        Ok(points)
    }

    /// The label of each point of a cloud, by time and ring and, if the cloud has these columns, angle and range.
    pub fn labels_of(&mut self, cloud: &Vertices) -> anyhow::Result<Vec<Labelled>> {
        let shots = shots(cloud)?;
        let lidars = cloud.has("lidar").then(|| cloud.u8s("lidar")).transpose()?;
        ensure!(lidars.as_ref().is_none_or(|lidars| lidars.len() == shots.len()), "a column of the cloud is too short");
        self.labels_of_shots(&shots, |i| lidars.as_ref().map_or(0, |lidars| lidars[i]))
    }

    /// The label of each shot. `lidar` gives the index of the LiDAR of a shot.
    pub fn labels_of_shots(
        &mut self,
        shots: &[Shot],
        lidar: impl Fn(usize) -> u8 + Sync,
    ) -> anyhow::Result<Vec<Labelled>> {
        let begin = self.read.map_or(i64::MAX, |[begin, _]| begin);
        let stamps = || shots.iter().map(|shot| shot.stamp).filter(|stamp| *stamp >= begin);
        if let (Some(first), Some(last)) = (stamps().min(), stamps().max()) {
            self.cover(first, last)?;
        }
        let label = |(i, shot): (usize, &Shot)| {
            // Only the first LiDAR has labels.
            if lidar(i) != 0 {
                return Err(NoLabel::NoSweep);
            }
            let found = find_label(&self.sweeps, shot)?;
            Ok(PointLabel { class: found.class, instance: found.instance.into() })
        };
        Ok(shots.par_iter().enumerate().map(label).collect())
    }

    /// Numbers of the sweeps without labels and of all sweeps that were read.
    pub fn unlabeled_sweeps(&self) -> [u64; 2] {
        [self.n_unlabeled, self.n_sweeps]
    }

    /// Stamps of the first and of the latest sweep that were read, ns.
    pub fn stamps_read(&self) -> Option<[i64; 2]> {
        self.read
    }

    /// Reads the sweeps from `first` to `last`, ns, and removes earlier ones.
    fn cover(&mut self, first: i64, last: i64) -> anyhow::Result<()> {
        // Clouds follow each other. Only a cloud out of this order makes a restart necessary.
        if self.forgotten.is_some_and(|end| first < end) {
            self.reader = reader(&self.drive)?;
            self.forgotten = None;
            self.sweeps.clear();
        }
        self.forget_before(first);
        while self.sweeps.last().is_none_or(|sweep| sweep.stamp() <= last) && self.read_sweep()? {
            self.forget_before(first);
        }
        Ok(())
    }

    fn forget_before(&mut self, first: i64) {
        let n_past = self.sweeps.partition_point(|sweep| sweep.end() < first);
        let past = self.sweeps.drain(..n_past).next_back();
        self.forgotten = past.map(|sweep| sweep.end()).or(self.forgotten);
    }

    /// Reads one more sweep. `false` at the end of the drive.
    fn read_sweep(&mut self) -> anyhow::Result<bool> {
        let Some(sweep) = self.reader.next_sweep().map_err(|problem| anyhow::anyhow!("{problem}"))? else {
            return Ok(false);
        };
        let is_new = self.read.is_none_or(|[_, latest]| sweep.stamp() > latest);
        self.n_sweeps += u64::from(is_new);
        self.n_unlabeled += u64::from(is_new && !sweep.has_labels());
        let [_, latest] = self.read.get_or_insert([sweep.stamp(); 2]);
        *latest = sweep.stamp().max(*latest);
        self.sweeps.push(sweep);
        Ok(true)
    }
}

fn reader(drive: &Drive) -> anyhow::Result<LabelReader> {
    drive.label_reader().map_err(|problem| anyhow::anyhow!("{problem}"))
}

/// Returns described by the columns of a cloud.
fn shots(cloud: &Vertices) -> anyhow::Result<Vec<Shot>> {
    let times = cloud.f64s("timestamp")?;
    let rings = cloud.u8s("ring")?;
    let azimuths = cloud.has("azimuth_deg").then(|| cloud.f32s("azimuth_deg")).transpose()?;
    let lidar = ["x_lidar_position", "y_lidar_position", "z_lidar_position"];
    let ranges = lidar.iter().all(|name| cloud.has(name)).then(|| ranges(cloud, lidar)).transpose()?;
    let n_points = cloud.len();
    ensure!(times.len() == n_points && rings.len() == n_points, "a column of the cloud is too short");
    let shot = |i: usize| Shot {
        stamp: nanos_of(times[i]),
        ring: rings[i],
        azimuth: azimuths.as_ref().map(|azimuths| (azimuths[i] * 100.0).round() as u16),
        range_m: ranges.as_ref().map(|ranges| ranges[i]),
    };
    Ok((0..n_points).map(shot).collect())
}

/// Distance of each point from the position of the LiDAR at its shot, m.
fn ranges(cloud: &Vertices, lidar: [&str; 3]) -> anyhow::Result<Vec<f32>> {
    let mut squares = vec![0.0_f64; cloud.len()];
    for (point, lidar) in ["x", "y", "z"].into_iter().zip(lidar) {
        let point = cloud.f64s(point)?;
        let lidar = cloud.f64s(lidar)?;
        for (square, (point, lidar)) in squares.iter_mut().zip(point.iter().zip(lidar)) {
            *square += (point - lidar) * (point - lidar);
        }
    }
    Ok(squares.into_iter().map(|square| square.sqrt() as f32).collect())
}

/// ns of a time in seconds. Whole seconds are handled separately: a double of seconds resolves 0.24 us, and one of nanoseconds would
/// round again. A time that is not finite is far from all sweeps.
fn nanos_of(time_s: f64) -> i64 {
    let nanos = (time_s.fract() * 1e9).round() as i64;
    (time_s.trunc() as i64).saturating_mul(1_000_000_000).saturating_add(nanos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_exact_to_the_resolution_of_a_double_and_never_overflows() {
        assert_eq!(nanos_of(1.5), 1_500_000_000);
        assert!((nanos_of(1_700_000_000.123_456_7) - 1_700_000_000_123_456_789).abs() < 250);
        assert_eq!(nanos_of(f64::NAN), 0);
        assert_eq!(nanos_of(f64::INFINITY), i64::MAX);
        assert_eq!(nanos_of(-1e300), i64::MIN);
    }
}
