//! The reflectances of one band, from the file of spectra of a cloud.

use anyhow::{Context, ensure};
use formats::ply::Vertices;
use std::path::Path;

/// Reflectance of each of the `n_points` points of `cloud` in the band nearest to a wavelength, NaN if unknown. `None` without
/// a file of spectra.
pub fn band(cloud: &Path, n_points: usize, wavelength_nm: f64) -> anyhow::Result<Option<Vec<f32>>> {
    let stem = cloud.file_stem().unwrap_or_default().to_string_lossy();
    let path = cloud.with_file_name(format!("{stem}_spectra.ply"));
    if !path.is_file() {
        return Ok(None);
    }
    let spectra = Vertices::load(&path)?;
    let names = spectra.properties().iter().map(|property| property.name.as_str());
    let bands = names.filter_map(|name| Some((band_nm(name)?, name)));
    let nearest = bands.min_by(|(a, _), (b, _)| (a - wavelength_nm).abs().total_cmp(&(b - wavelength_nm).abs()));
    let (_, name) = nearest.with_context(|| format!("{}: has no bands", path.display()))?;
    let mut values = vec![f32::NAN; n_points];
    for (point_idx, value) in spectra.i64s("point_idx")?.into_iter().zip(spectra.f32s(name)?) {
        let place = usize::try_from(point_idx).ok().filter(|index| *index < n_points);
        ensure!(place.is_some(), "{}: point {point_idx} is not in a cloud of {n_points} points", path.display());
        if let Some(index) = place {
            values[index] = value;
        }
    }
    Ok(Some(values))
}

/// The wavelength in a name such as `band_0623nm`, nm.
fn band_nm(property: &str) -> Option<f64> {
    property.strip_prefix("band_")?.split_once("nm")?.0.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, PlyWriter};

    #[test]
    fn nearest_band_is_read_by_number_of_the_point() {
        let folder = tempfile::tempdir().expect("a folder");
        let cloud = folder.path().join("submap_0001.ply");
        assert!(band(&cloud, 3, 650.0).expect("reads").is_none());
        let fields = [("point_idx", Kind::Int), ("band_0600nm", Kind::Float), ("band_0648nm_b07", Kind::Float)];
        let path = folder.path().join("submap_0001_spectra.ply");
        let mut writer = PlyWriter::create(&path, &Header::new(fields), 1).expect("creates");
        writer
            .write_each(1, |_, row| {
                row.i32(2).f32(0.1).f32(0.4);
            })
            .expect("writes");
        writer.finish().expect("finishes");
        let values = band(&cloud, 3, 650.0).expect("reads").expect("is there");
        assert!(values[0].is_nan() && values[2] == 0.4, "{values:?}");
        let error = band(&cloud, 2, 650.0).expect_err("has no such point").to_string();
        assert!(error.contains("point 2 is not in a cloud of 2 points"), "{error}");
    }
}
