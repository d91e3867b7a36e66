//! Checks that a run can read the drive of an import, and writes how its clouds are read into `drive.toml`.

use crate::cameras::image_size;
use crate::error::{At, ImportError};
use drive::manifest::{LidarEntry, Manifest};
use drive::{Drive, MANIFEST_FILE, SweepSource};
use formats::cloud_fields::MapOrigin;
use std::fs;
use std::path::Path;

/// Factors of intensities that follow from the page of the drive folder.
const DOCUMENTED: [f64; 2] = [1.0, 255.0];

/// Lines of the report. Fails if none of a few evenly spaced clouds of a LiDAR can be read by a run. `folder`: the drive, which
/// is named `out` afterwards. `has_own_clouds`: the clouds are files of the source, so their times and rings are not in the
/// report yet.
pub(crate) fn check(
    drive: &Drive,
    folder: &Path,
    out: &Path,
    has_own_clouds: bool,
) -> Result<Vec<String>, ImportError> {
    let mut report = Vec::new();
    let mut manifest = drive.manifest().clone();
    for (index, lidar) in drive.lidars().enumerate() {
        if lidar.format == "pcap" || lidar.files.is_empty() {
            continue;
        }
        let mut source = SweepSource::open(lidar).at(out)?;
        let sample = source.sample();
        if let Some(first) = sample.faults.first() {
            // The path in the drive does not exist after a failure.
            let first = first.replace(&*folder.to_string_lossy(), &out.to_string_lossy());
            if sample.faults.len() == sample.n_files {
                let rule = format!("a run cannot read its sweeps, {} of {0} examined: {first}", sample.n_files);
                return Err(ImportError::at(out, rule));
            }
            report.push(format!(
                "a run cannot read {} of {} sweeps examined and leaves them out, the first: {first}",
                sample.faults.len(),
                sample.n_files
            ));
        }
        if sample.n_empty > 0 {
            report.push(format!("{} of {} sweeps examined have no returns", sample.n_empty, sample.n_files));
        }
        let Some(form) = source.form() else { continue };
        if has_own_clouds {
            let is_found =
                |line: &&String| !line.ends_with("the files contain no times") && !line.ends_with("no rings");
            report.extend(form.report.iter().filter(is_found).cloned());
        }
        report.extend(form.changes());
        let Some(entry) = entry_of(&mut manifest, index) else { continue };
        if !DOCUMENTED.contains(&form.intensities.factor) {
            entry.intensity_scale = Some(form.intensities.factor);
        }
        entry.map_origin = form.origin.map(|MapOrigin(origin)| origin);
    }
    for (entry, index) in drive.manifest().cameras.iter().zip(0..) {
        let Some(frame) = drive.camera_frames().iter().find(|frame| frame.camera == index) else { continue };
        let path = fs::canonicalize(&frame.path).unwrap_or_else(|_| frame.path.clone());
        let (width, height) = entry.model.size();
        let fault = match image_size(&path) {
            Ok([w, h]) if [w, h] == [width, height] => continue,
            Ok([w, h]) => format!("{}: {w} x {h} px, the camera has {width} x {height}", path.display()),
            Err(error) => error.to_string(),
        };
        report.push(format!("a run cannot read the first image of camera {}: {fault}", entry.name));
    }
    if manifest != *drive.manifest() {
        let path = folder.join(MANIFEST_FILE);
        let text = toml::to_string(&manifest).at(&path)?;
        fs::write(&path, text).at(&path)?;
    }
    Ok(report)
}

fn entry_of(manifest: &mut Manifest, index: usize) -> Option<&mut LidarEntry> {
    match index.checked_sub(1) {
        None => Some(&mut manifest.lidar),
        Some(other) => manifest.other_lidars.get_mut(other),
    }
}
