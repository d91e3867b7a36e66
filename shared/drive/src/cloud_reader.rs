//! Reads sweeps stored as one cloud file each.

use super::DriveLidar;
use super::clouds::returns;
use super::lidars::median_interval_nanos;
use super::rings::cloud_rings;
use files::regular_file;
use formats::cloud::{FiredCloud, FiredPoint, MAX_RANGE_M};
use formats::cloud_fields::{
    CloudForm, CoordinateFault, FieldFault, FormBuilder, IntensitySample, IntensityScale, MapOrigin, ValueType, sampled,
};
use formats::{kitti, nuscenes, pcd};
use geometry::Stamp;
use lidar::{Lidar, SweepPoint, SweepReader};
use std::io;
use std::path::Path;

/// Error of a cloud file that cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum CloudFault {
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Kitti(#[from] kitti::KittiError),
    #[error(transparent)]
    Nuscenes(#[from] nuscenes::NuscenesError),
    #[error(transparent)]
    Pcd(#[from] pcd::PcdError),
    #[error(transparent)]
    Coordinates(#[from] CoordinateFault),
    #[error(transparent)]
    Fields(#[from] FieldFault),
    #[error("{found} points; a sweep has at most {limit}")]
    TooManyPoints { found: usize, limit: usize },
    #[error("ring {ring}: a {model} has {n_rings} rings, counted from 0; set lidar.model")]
    Ring { ring: u8, n_rings: usize, model: &'static str },
    #[error(
        "points reach {found_nanos} ns after the sweep's stamp, the next sweep begins after {next_nanos} ns; times must begin at the stamp"
    )]
    Late { found_nanos: u32, next_nanos: u32 },
}

/// The returns of a cloud file.
#[derive(Debug)]
pub(super) struct CloudReturns {
    /// The returns, sorted by time if they have times, otherwise in the order of the file.
    pub(super) returns: Vec<SweepPoint>,
    pub(super) has_times: bool,
}

/// Reader of the cloud files of a LiDAR.
#[derive(Debug)]
pub(super) struct CloudReader {
    format: String,
    lidar: Lidar,
    form: CloudForm,
}

impl CloudReader {
    /// Determines the form of the recording from a few of its files. Files that cannot be read are left to [`CloudReader::load`].
    pub(super) fn open(of: &DriveLidar) -> Self {
        let lidar = of.lidar.clone();
        let format = of.format.clone();
        let mut form = if format == "pcd" { pcd_form(of) } else { CloudForm::untimed(rows_scale(of)) };
        if let Some(factor) = of.intensity_scale {
            form.intensities = IntensityScale::set(factor);
        }
        form.origin = of.map_origin.map(MapOrigin).or(form.origin);
        Self { format, lidar, form }
    }

    /// How the files are read.
    pub(super) fn form(&self) -> &CloudForm {
        &self.form
    }

    /// The returns of a cloud file. `stamp`: stamp of its sweep, before the correction of the form.
    pub(super) fn load(&self, path: &Path, stamp: Stamp) -> Result<CloudReturns, CloudFault> {
        let bytes = regular_file::read(path)?;
        let untimed = |returns| CloudReturns { returns, has_times: false };
        let scale = self.form.intensities.factor as f32;
        let found = match self.format.as_str() {
            "bin" => {
                let points = kitti::points_from_bin(&bytes)?;
                untimed(returns(
                    &points,
                    scale,
                    |point| FiredPoint { point: *point, ..FiredPoint::default() },
                    &cloud_rings(&points, |point| *point, &self.lidar),
                ))
            }
            "nuscenes" => {
                let rows = nuscenes::points_from_bin(&bytes)?;
                untimed(returns(
                    &rows,
                    scale,
                    |(point, _)| FiredPoint { point: *point, ..FiredPoint::default() },
                    &rows.iter().map(|(_, ring)| *ring).collect::<Vec<u8>>(),
                ))
            }
            _ => {
                let raw = pcd::raw_from_pcd(&bytes)?;
                // Its error names the reason; the origin itself belongs to the recording.
                let is_map = raw.map_origin()?.is_some();
                let cloud = self.form.fired(&raw, stamp.0)?;
                raw.check_extent(self.form.origin.filter(|_| is_map), f64::from(MAX_RANGE_M))?;
                self.returns(&cloud)?
            }
        };
        let limit = SweepReader::MAX_RETURNS;
        if found.returns.len() > limit {
            return Err(CloudFault::TooManyPoints { found: found.returns.len(), limit });
        }
        Ok(found)
    }

    /// Returns with the rings and times of the file, sorted by time.
    fn returns(&self, cloud: &FiredCloud) -> Result<CloudReturns, CloudFault> {
        let n_rings = self.lidar.n_rings();
        let beyond = |p: &&FiredPoint| cloud.has_rings && n_rings > 0 && usize::from(p.ring) >= n_rings;
        if let Some(FiredPoint { ring, .. }) = cloud.points.iter().find(beyond) {
            return Err(CloudFault::Ring { ring: *ring, n_rings, model: self.lidar.model().name() });
        }
        let rings = if cloud.has_rings {
            cloud.points.iter().map(|p| p.ring).collect()
        } else {
            cloud_rings(&cloud.points, |p| p.point, &self.lidar)
        };
        let mut returns = returns(&cloud.points, self.form.intensities.factor as f32, |p| *p, &rings);
        if !returns.is_sorted_by_key(|found| found.offset_nanos) {
            returns.sort_by_key(|found| found.offset_nanos);
        }
        Ok(CloudReturns { returns, has_times: cloud.has_times })
    }
}

/// The form of PCD files.
fn pcd_form(of: &DriveLidar) -> CloudForm {
    let n_beams = u16::try_from(of.lidar.n_rings()).ok().filter(|n| *n > 0);
    let interval_s = median_interval_nanos(&of.stamps).map(|nanos| nanos as f64 * 1e-9);
    let mut builder = FormBuilder::for_drive(interval_s, n_beams);
    let files: Vec<_> = of.files.iter().zip(&of.stamps).collect();
    for (path, stamp) in sampled(&files) {
        if let Some(cloud) = regular_file::read(path).ok().and_then(|bytes| pcd::raw_from_pcd(&bytes).ok()) {
            // Clouds with invalid coordinates are left out here and refused when they are loaded.
            let _ = builder.add(&cloud, Some(stamp.0));
        }
    }
    builder.finish()
}

/// The scale of the intensities of files without header.
fn rows_scale(of: &DriveLidar) -> IntensityScale {
    let mut sample = IntensitySample::default();
    for path in sampled(&of.files) {
        let Ok(bytes) = regular_file::read(path) else { continue };
        let intensities: Vec<f64> = if of.format == "bin" {
            let points = kitti::points_from_bin(&bytes).unwrap_or_default();
            points.iter().map(|point| f64::from(point.intensity)).collect()
        } else {
            let rows = nuscenes::points_from_bin(&bytes).unwrap_or_default();
            rows.iter().map(|(point, _)| f64::from(point.intensity)).collect()
        };
        sample.add_values(ValueType::F32, intensities.into_iter());
    }
    sample.scale()
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::cloud::CloudPoint;
    use lidar::Model;
    use lidar::velodyne::Model as Velodyne;

    fn reader(model: Model) -> CloudReader {
        CloudReader { format: "pcd".into(), lidar: model.into(), form: CloudForm::default() }
    }

    /// Points of a raw sweep are ordered by beam, from the highest to the lowest. A jump of the azimuth marks the next beam.
    #[real_data::test("kitti_raw_0048/0000000003.pcd")]
    fn rings_of_real_sweep_match_the_order_of_its_points() {
        let path = real_data::path("kitti_raw_0048/0000000003.pcd");
        let returns = reader(Velodyne::Hdl64e.into()).load(&path, Stamp(0)).expect("reads").returns;
        let mut ring = 63_u8;
        let mut n_right = 0;
        let mut last = 0.0_f32;
        for found in &returns {
            let angle = found.y.atan2(found.x);
            if last < 0.0 && angle >= 0.0 && angle - last < 1.0 {
                ring = ring.saturating_sub(1);
            }
            last = angle;
            n_right += usize::from(found.ring == ring);
        }
        assert_eq!(ring, 0);
        assert!(n_right * 1000 > returns.len() * 998, "{n_right} of {}", returns.len());
    }

    #[test]
    fn returns_with_times_are_in_firing_order_and_keep_their_rings() {
        let point = CloudPoint { x: 5.0, intensity: 9.0, ..CloudPoint::default() };
        let fired = |(ring, offset_nanos)| FiredPoint { point, ring, offset_nanos };
        let points = [(0, 50_000), (15, 0), (1, 50_000), (0, 99_000_000)].map(fired).to_vec();
        let mut cloud = FiredCloud { points, has_rings: true, has_times: true };
        let found = reader(Velodyne::Vlp16.into()).returns(&cloud).expect("valid");
        let order: Vec<(u8, u32)> = found.returns.iter().map(|found| (found.ring, found.offset_nanos)).collect();
        assert!(found.has_times && order == [(15, 0), (0, 50_000), (1, 50_000), (0, 99_000_000)], "{order:?}");
        cloud.points[2].ring = 16;
        let error = reader(Velodyne::Vlp16.into()).returns(&cloud).expect_err("is beyond").to_string();
        assert!(error.starts_with("ring 16: a vlp16 has 16 rings"), "{error}");
    }
}
