//! Evaluates a model on labelled real streets of several sensors: a folder with one data set per subfolder.
//!
//! | data set | files | labels |
//! |---|---|---|
//! | `SemanticKITTI` | `*.bin` with `*.label` | its ids |
//! | Livox Avia | the same, returns in front of the sensor only | ids of `SemanticKITTI` |
//! | RELLIS-3D | the same | its ids; asphalt and concrete are road, dirt, grass and mud terrain |
//! | Oakland 3-D | `*.xyz_label_conf`, `*.xyz_label_conf.gz` | its ids |
//!
//! Classes that a data set does not distinguish are merged before scoring ([`Labels::merged`]).

mod clouds;
mod sweeps;

use super::folder::sorted_entries;
use super::labelled_submap::LabelledSubmap;
use super::labels::Labels;
use super::models::Models;
use super::source::{Origin, Source};
use super::tally::Tally;
use command_line::say_error;
use segmentation::Segmenter;
use std::path::{Path, PathBuf};

/// A data set, or a part of one that is scored together.
struct Street {
    name: String,
    labels: Labels,
    submaps: Vec<LabelledSubmap>,
}

/// Scores the model on each data set of a folder. Subfolders without labels of points are named on stderr.
pub fn sources(models: &Models, folder: &Path, empty: &Tally) -> anyhow::Result<Vec<Source>> {
    let mut sources = Vec::new();
    // A folder with sweeps is itself a data set; its places would be subfolders.
    let is_one = !sweeps::labelled(folder)?.is_empty() || clouds::has_clouds(folder)?;
    let folders = if is_one { vec![folder.to_owned()] } else { subfolders(folder)? };
    for folder in &folders {
        match street(folder)? {
            Some(street) => sources.push(source(models, &street, empty)?),
            None => say_error!("{}: has no labels of points", folder.display()),
        }
    }
    anyhow::ensure!(
        !sources.is_empty(),
        "{}: no labelled points in this folder and its subfolders; there must be *.bin with *.label files, or *.xyz_label_conf[.gz] files",
        folder.display()
    );
    Ok(sources)
}

/// The data set of a folder; `None` if it has no labels of points.
fn street(folder: &Path) -> anyhow::Result<Option<Street>> {
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let sweeps = sweeps::find(folder)?;
    if !sweeps.is_empty() {
        let (labels, submaps) = sweeps::read(&sweeps)?;
        return Ok(Some(Street { name, labels, submaps }));
    }
    if clouds::has_clouds(folder)? {
        return Ok(Some(Street { name, labels: Labels::Oakland, submaps: clouds::read(folder)? }));
    }
    Ok(None)
}

fn source(models: &Models, street: &Street, empty: &Tally) -> anyhow::Result<Source> {
    let score = |model: &dyn Segmenter| -> anyhow::Result<Tally> {
        let mut tally = empty.clone();
        for submap in &street.submaps {
            submap.score(&mut tally, model, street.labels)?;
        }
        Ok(tally)
    };
    let has_intensities = street.submaps.iter().any(|submap| submap.points.iter().any(|point| point.intensity > 0));
    let mut other_uses = Vec::new();
    if has_intensities {
        for (word, model) in &models.other_uses {
            other_uses.push((*word, score(model.as_ref())?));
        }
    }
    let n_sweeps = street.submaps.iter().map(|submap| submap.header.n_sweeps as usize).sum();
    let tally = score(models.asked.as_ref())?;
    say_error!("{}: {} points", street.name, tally.classes.n());
    let origin = Origin::Street(street.name.clone());
    Ok(Source { name: street.name.clone(), origin, n_sweeps, has_intensities, tally, other_uses })
}

/// The subfolders, in the order of their names.
fn subfolders(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    Ok(sorted_entries(folder)?.into_iter().filter(|path| path.is_dir()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[real_data::test("street_labels")]
    fn labelled_streets_of_four_sensors_are_found() {
        let folders = subfolders(&real_data::path("street_labels")).expect("is a folder");
        let streets: Vec<Street> = folders.iter().filter_map(|folder| street(folder).expect("is read")).collect();
        let described = streets.iter().map(|street| {
            let n_labelled: usize = street.submaps.iter().map(|submap| submap.truth.iter().flatten().count()).sum();
            (street.name.as_str(), street.labels, n_labelled)
        });
        assert_eq!(
            described.collect::<Vec<_>>(),
            [
                ("avia", Labels::SemanticKitti, 85_590),
                ("oakland", Labels::Oakland, 476_903),
                ("rellis_os1", Labels::Rellis, 62_788),
                ("semantickitti_spv", Labels::SemanticKitti, 116_465),
            ]
        );
        // Only the HDL-64E has rings, and the invented scanner of Oakland.
        assert_eq!(streets.iter().map(|street| street.submaps[0].header.n_rings).collect::<Vec<_>>(), [0, 64, 0, 64]);
    }

    #[test]
    fn folder_without_labels_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("000000.bin"), [0; 16]).expect("writes");
        assert!(street(folder.path()).expect("is read").is_none());
    }

    #[test]
    fn sweep_with_other_ids_or_lengths_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let error = |labels: &[u32]| {
            std::fs::write(folder.path().join("000000.bin"), [0; 32]).expect("writes");
            let bytes: Vec<u8> = labels.iter().flat_map(|label| label.to_le_bytes()).collect();
            std::fs::write(folder.path().join("000000.label"), bytes).expect("writes");
            street(folder.path()).err().expect("is refused").to_string()
        };
        assert!(error(&[40]).contains("2 points, but 1 labels"));
        assert!(error(&[3, 40]).contains("the ids [3, 40] are of neither SemanticKITTI nor RELLIS-3D"));
    }
}
