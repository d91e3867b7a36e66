//! Reflectances of the points of a cloud that a mosaic camera recorded.

use super::Cloud;
use crate::error::DeliverError;
use crate::run_folder::RunFolder;
use formats::ply::{Kind, PlyRows};
use std::path::PathBuf;

/// The spectra of one cloud, in memory.
pub(crate) struct Spectra {
    /// Numbers of the points, ascending.
    points: Vec<u32>,
    /// Reflectances, `n_bands` for each point.
    values: Vec<f32>,
    n_bands: usize,
}

/// Names of the bands of runs. All clouds of spectra must have the same bands. Empty without spectra.
pub(crate) fn band_names(runs: &[RunFolder]) -> Result<Vec<String>, DeliverError> {
    let mut clouds = runs.iter().flat_map(|run| run.index.clouds.iter().map(move |cloud| (run, cloud)));
    let Some((run, file)) = clouds.find_map(|(run, cloud)| Some((run, cloud.spectra.as_ref()?))) else {
        return Ok(Vec::new());
    };
    let rows = PlyRows::open(&run.path().join(&file.file))?;
    Ok(bands(&rows).map(|(name, _)| name).collect())
}

/// Names of the bands and their offsets in a row.
fn bands(rows: &PlyRows) -> impl Iterator<Item = (String, usize)> + '_ {
    let mut at = 0;
    rows.header().properties.iter().filter_map(move |property| {
        let here = at;
        at += property.kind.size();
        (property.name.starts_with("band_") && property.kind == Kind::Float).then(|| (property.name.clone(), here))
    })
}

impl Spectra {
    /// Reads the spectra of a cloud, which holds the points of one submap. `names` are the bands of the run; if it is
    /// empty, there are no spectra.
    pub(crate) fn load(cloud: &Cloud<'_>, names: &[String]) -> Result<Self, DeliverError> {
        let mut spectra = Self { points: Vec::new(), values: Vec::new(), n_bands: names.len() };
        let Some(entry) = cloud.entry.spectra.as_ref().filter(|_| !names.is_empty()) else { return Ok(spectra) };
        let path: PathBuf = cloud.run.path().join(&entry.file);
        let rows = PlyRows::open(&path)?;
        let (found, at): (Vec<String>, Vec<usize>) = bands(&rows).unzip();
        if found != names {
            let rule = format!("has bands {found:?}, the clouds before have {names:?}");
            return Err(DeliverError::content(&path, rule));
        }
        let mut point_at = 0;
        let index = rows.header().properties.iter().find_map(|property| {
            let here = point_at;
            point_at += property.kind.size();
            (property.name == "point_idx" && property.kind == Kind::Int).then_some(here)
        });
        let index =
            index.ok_or_else(|| DeliverError::content(&path, "the cloud has no column `point_idx` of type int"))?;
        let row_size = rows.header().row_size();
        let mut bytes = vec![0; rows.len() * row_size];
        rows.read_into(0, &mut bytes)?;
        for row in bytes.chunks_exact(row_size.max(1)) {
            let point = Kind::Int.value(&row[index..]) as u32;
            if spectra.points.last().is_some_and(|last| *last >= point) {
                return Err(DeliverError::content(&path, "column `point_idx` must increase"));
            }
            spectra.points.push(point);
            spectra.values.extend(at.iter().map(|at| Kind::Float.value(&row[*at..]) as f32));
        }
        Ok(spectra)
    }

    /// Reflectances of a point by its number; NaN = not measured. `None` if no camera recorded the point.
    #[inline]
    pub(crate) fn get(&self, point: usize) -> Option<&[f32]> {
        let k = self.points.binary_search(&(point as u32)).ok()?;
        self.values.get(k * self.n_bands..(k + 1) * self.n_bands)
    }
}
