//! `MandEye`: chunks of a Livox scanner, `lidar*.laz` with times, of its IMU, `imu*.csv`, and of a GNSS receiver. Points are cut into
//! sweeps of a tenth of a second. The body frame is the LiDAR frame.

mod chunks;
mod gnss;
mod imu;

use crate::error::ImportError;
use crate::files::files;
use crate::plan::{Conversion, Plan, TextFile};
use crate::sweeps::{LIDAR_FOLDER, Sweeps};
use crate::{Kind, Options};
use chunks::Chunks;
use drive::imu::csv_from_samples;
use drive::manifest::{ImuEntry, LidarEntry, PoseEntry};
use lidar::{SweepReader, livox};
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Position of the IMU of a Mid-360 in the frame of its points, m (user manual).
const IMU_OF_MID_360: [f64; 3] = [0.011, 0.023_29, -0.044_12];

/// The chunks of the LiDAR.
pub(crate) fn lidar_files(source: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let found = files(source, ".laz")?.into_iter().filter(|(name, _)| name.starts_with("lidar"));
    Ok(found.map(|(_, path)| path).collect())
}

/// The drive of a folder.
pub(crate) fn plan(source: &Path, options: &Options) -> Result<Plan, ImportError> {
    let originals = lidar_files(source)?;
    let chunks = Rc::new(Chunks::scan(originals.clone())?);
    let model = options.model.unwrap_or(livox::Model::Mid360.into());
    let lidar = LidarEntry::new(model.name(), "pcd", LIDAR_FOLDER, PoseEntry::IDENTITY);
    let times: Vec<i64> = chunks.sweeps().iter().map(|sweep| sweep.stamp).collect();
    let name = |seq: usize| format!("{seq:06}.pcd");
    let named = Sweeps { files: (0..times.len()).map(|seq| (name(seq), PathBuf::new())).collect(), times: Some(times) };
    let mut plan = named.plan(Kind::Mandeye, &crate::drive_name(source, Kind::Mandeye), lidar);
    plan.links.clear();
    plan.report.extend(chunks.flags().lines());
    if let Some(sweep) = chunks.sweeps().iter().find(|sweep| sweep.n_points > SweepReader::MAX_RETURNS) {
        let rule = format!(
            "{} points in a tenth of a second; a sweep has at most {}",
            sweep.n_points,
            SweepReader::MAX_RETURNS
        );
        return Err(ImportError::at(source, rule));
    }
    for seq in 0..named.files.len() {
        let chunks = chunks.clone();
        plan.conversions.push(Conversion {
            place: Path::new(LIDAR_FOLDER).join(name(seq)),
            originals: Vec::new(),
            content: Box::new(move || Ok(chunks.sweep(seq)?.into())),
        });
    }
    plan.read.extend(originals);
    if !options.lidar_only {
        let inputs: Vec<PathBuf> = imu::files_of(source)?;
        if !inputs.is_empty() {
            let log = imu::read(&inputs)?;
            plan.report.push(format!("imported: {} IMU samples{}", log.samples.len(), log.note));
            plan.texts.push(TextFile { place: "imu.csv".into(), text: csv_from_samples(&log.samples) });
            let position_in_body = if model == livox::Model::Mid360.into() { IMU_OF_MID_360 } else { [0.0; 3] };
            plan.manifest.imu =
                Some(ImuEntry { delay_nanos: 0, file: "imu.csv".into(), position_in_body, body_from_imu: None });
            plan.read.extend(inputs);
        }
        gnss::add(&mut plan, source)?;
    }
    Ok(plan)
}
