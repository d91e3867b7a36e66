//! The points of a run as octree, and its objects. Both take longer to make than the rest, so they are kept in the folder of
//! the run.

use super::scene::SceneObject;
use crate::data::deliver::frame::ChosenFrame;
use crate::data::deliver::{COPC_FILE, SOFTWARE, SYSTEM, progress_bar};
use anyhow::Context;
use files::atomic_file::write_atomic;
use files::regular_file;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;
use surveying::objects::objects_of;
use surveying::{CloudOptions, RunFolder, write_copc};

/// Name of the folder in the output folder of the run.
const FOLDER: &str = "view";
const OBJECTS: &str = "objects.json";
/// List of the sources of the other files. Written last: without it they may be incomplete.
const SOURCES: &str = "sources.txt";
/// `write_copc` reads, places and writes each point.
const PASSES: u64 = 3;

/// Files of the cache.
pub struct CachedCloud {
    /// The octree.
    pub cloud: PathBuf,
    pub objects: Vec<SceneObject>,
}

impl CachedCloud {
    /// Reuses the cache if it was made from the same files with the same options, else makes it.
    pub fn open_or_create(run: &RunFolder, frame: &ChosenFrame<'_>, has_bands: bool) -> anyhow::Result<Self> {
        let folder = run.path().join(FOLDER);
        let sources = sources(run, frame, has_bands)?;
        let cloud = folder.join(COPC_FILE);
        let objects_file = folder.join(OBJECTS);
        let sources_file = folder.join(SOURCES);
        let is_same = regular_file::read_to_string(&sources_file).is_ok_and(|text| text == sources);
        if is_same
            && cloud.exists()
            && let Some(objects) =
                regular_file::read(&objects_file).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok())
        {
            return Ok(Self { cloud, objects });
        }
        fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        remove(&sources_file)?;
        write_cloud(run, frame, has_bands, &folder)?;
        let objects = objects_of(run)?.unwrap_or_default();
        let objects: Vec<SceneObject> =
            objects.iter().map(|object| SceneObject::from_summary(object, &frame.target)).collect::<Result<_, _>>()?;
        write(&objects_file, &serde_json::to_vec(&objects)?)?;
        write(&sources_file, sources.as_bytes())?;
        Ok(Self { cloud, objects })
    }
}

fn write_cloud(run: &RunFolder, frame: &ChosenFrame<'_>, has_bands: bool, folder: &Path) -> anyhow::Result<()> {
    let options = CloudOptions {
        has_bands,
        has_ground_as_2: false,
        system: SYSTEM.to_owned(),
        software: SOFTWARE.to_owned(),
        note: frame.note(),
    };
    let bar = progress_bar("view", run.index.n_points * PASSES);
    write_copc(std::slice::from_ref(run), &frame.target, &options, folder, COPC_FILE, |n| bar.inc(n))?;
    bar.finish_and_clear();
    Ok(())
}

/// Sources of the cache: options, and size and time of each file that is read.
fn sources(run: &RunFolder, frame: &ChosenFrame<'_>, has_bands: bool) -> anyhow::Result<String> {
    let mut text = format!("{SOFTWARE}\nbands: {has_bands}\n{}\n", frame.target.description());
    for entry in &run.index.clouds {
        let spectra = entry.spectra.as_ref().filter(|_| has_bands).map(|spectra| &spectra.file);
        for file in [Some(&entry.file), spectra].into_iter().flatten() {
            let path = run.path().join(file);
            let metadata = fs::metadata(&path).with_context(|| path.display().to_string())?;
            let modified = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{file} {} {}", metadata.len(), modified.unwrap_or_default().as_nanos());
        }
    }
    Ok(text)
}

fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    write_atomic(path, bytes).with_context(|| path.display().to_string())
}

fn remove(path: &Path) -> anyhow::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| path.display().to_string())
        }
        _ => Ok(()),
    }
}
