//! Registered clouds, imported as `replica import` does.

use crate::evaluate::classes::labelled_submap::LabelledSubmap;
use crate::evaluate::classes::tally::TrueClass;
use crate::train::camera_columns::CameraNeeds;
use crate::train::recipe_data::RecordingSource;
use crate::train::recorded_sweeps::RecordedSweeps;
use anyhow::Context;
use import::{Kind, Options};
use messages::ClassId;
use std::path::Path;

/// Whether a folder has clouds with labels.
pub fn has_clouds(folder: &Path) -> anyhow::Result<bool> {
    Ok(Kind::Oakland.fits(folder)?)
}

/// The clouds of a folder as submaps.
pub fn read(folder: &Path) -> anyhow::Result<Vec<LabelledSubmap>> {
    let scratch = tempfile::tempdir().context("a temporary folder for the recording of the clouds")?;
    let path = scratch.path().join("clouds.mcap");
    import::import(folder, &path, &Options { kind: Some(Kind::Oakland), ..Options::default() })?;
    let mut recording = RecordedSweeps::open(&RecordingSource::new(path), scratch.path(), &CameraNeeds::default())?;
    let mut submaps = Vec::new();
    while let Some(submap) = recording.next()? {
        let truth = |class: &u8| (*class != ClassId::Unlabeled as u8).then(|| TrueClass::from_id(*class));
        let truth = submap.classes.iter().map(truth).collect();
        submaps.push(LabelledSubmap { header: Box::new(submap.header), points: submap.points, truth });
    }
    Ok(submaps)
}
