//! Post-processed trajectories next to the files of a drive.

use crate::error::{At, ImportError};
use crate::files::files;
use crate::plan::{Link, Plan};
use drive::manifest::{TrajectoryEntry, TrajectoryFormat};
use files::regular_file;
use formats::novatel::NovatelLog;
use formats::pose_table::{PlaceKind, PoseTable};
use formats::sbet::records_from_sbet;
use formats::smrmsg::records_from_smrmsg;
use std::path::{Path, PathBuf};

/// A file with poses.
struct Found {
    name: String,
    path: PathBuf,
    format: TrajectoryFormat,
}

/// Adds the trajectory of the folder of the source, if it holds exactly one.
pub(crate) fn add(plan: &mut Plan, source: &Path) -> Result<(), ImportError> {
    let folder = if source.is_dir() { source } else { source.parent().unwrap_or(Path::new(".")) };
    let taken: Vec<PathBuf> = plan.read.iter().filter_map(|path| path.canonicalize().ok()).collect();
    let mut found = Vec::new();
    for (name, path) in files(folder, "")?.into_iter().filter(|(_, path)| !taken.contains(path)) {
        if let Some(format) = format(&name, &path)? {
            found.push(Found { name, path, format });
        }
    }
    let [only] = &found[..] else {
        if !found.is_empty() {
            let names: Vec<&str> = found.iter().map(|found| found.name.as_str()).collect();
            let list = names.join(", ");
            plan.report
                .push(format!("not imported: several trajectories ({list}); name one in [trajectory] of drive.toml"));
        }
        return Ok(());
    };
    let place = format!("trajectory/{}", only.name);
    let mut entry = TrajectoryEntry::new(&place, only.format);
    plan.links.push(Link { place: place.into(), original: only.path.clone() });
    if only.format == TrajectoryFormat::Sbet {
        let deviations: Vec<(String, PathBuf)> =
            files(folder, "")?.into_iter().filter(|(name, _)| name.to_lowercase().contains("smrmsg")).collect();
        let is_smrmsg = |path: &Path| regular_file::read(path).is_ok_and(|bytes| records_from_smrmsg(&bytes).is_ok());
        let mut deviations = deviations.into_iter().filter(|(_, path)| is_smrmsg(path));
        if let (Some((name, path)), None) = (deviations.next(), deviations.next()) {
            let place = format!("trajectory/{name}");
            plan.links.push(Link { place: place.clone().into(), original: path });
            entry.deviations = Some(place);
        }
    }
    plan.manifest.trajectory = Some(entry);
    plan.report.push(format!(
        "imported: the trajectory {}, taken as the path of the body; set trajectory.body_from_reference to the reference point of its \
         export, and slam_aggregate.path to use it",
        only.name
    ));
    Ok(())
}

/// The format of a trajectory; `None` for other files. Names select the files that are read.
fn format(name: &str, path: &Path) -> Result<Option<TrajectoryFormat>, ImportError> {
    let lower = name.to_lowercase();
    let ends = |ends: &[&str]| ends.iter().any(|end| lower.ends_with(end));
    let is_sbet = ends(&[".sbet"]) || lower.contains("sbet") && ends(&[".out"]);
    if is_sbet {
        let bytes = regular_file::read(path).at(path)?;
        return Ok(records_from_sbet(&bytes).is_ok_and(|records| records.len() > 1).then_some(TrajectoryFormat::Sbet));
    }
    if ends(&[".gps", ".asc", ".ascii", ".log"]) {
        let log = NovatelLog::from_bytes(&regular_file::read(path).at(path)?);
        return Ok((log.poses.len() > 1).then_some(TrajectoryFormat::Novatel));
    }
    if ends(&[".txt", ".csv"]) {
        let text = regular_file::read_to_string(path).unwrap_or_default();
        let table = PoseTable::from_text(&text);
        let is_path = table.is_ok_and(|table| table.place == PlaceKind::Geodetic && table.rows.len() > 1);
        return Ok(is_path.then_some(TrajectoryFormat::Table));
    }
    Ok(None)
}
