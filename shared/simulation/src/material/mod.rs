//! What surfaces are made of: reflectance spectrum, pattern, and how a laser beam and a mirror image fare on it.
//!
//! Colors and laser intensities follow from the spectra, so that all sensors tell the same story.

mod table;
mod texture;

pub use table::Material;

use crate::spectrum::Spectrum;
use texture::Pattern;

/// All that the sensors need to know of a material.
#[derive(Clone, Debug)]
pub struct Properties {
    /// Diffuse reflectance, 0 to 1.
    pub spectrum: Spectrum,
    /// Share of beams that are lost (mirrored away or let through).
    pub beam_loss: f32,
    /// Returned by a reflecting foil, added to the diffuse reflectance; 1 fills the upper half of the intensities.
    pub retroreflection: f32,
    /// Share of the camera's light that is the mirrored sky at normal incidence.
    pub gloss: f32,
    pattern: Pattern,
}

impl Properties {
    /// A rough surface.
    const fn of(spectrum: Spectrum, pattern: Pattern) -> Self {
        Self { spectrum, beam_loss: 0.0, retroreflection: 0.0, gloss: 0.0, pattern }
    }
    const fn loses(mut self, beam_loss: f32) -> Self {
        self.beam_loss = beam_loss;
        self
    }
    const fn foil(mut self, retroreflection: f32) -> Self {
        self.retroreflection = retroreflection;
        self
    }
    const fn gloss(mut self, gloss: f32) -> Self {
        self.gloss = gloss;
        self
    }
}

impl Material {
    /// Diffuse reflectance, 0 to 1.
    pub fn spectrum(self) -> Spectrum {
        self.properties().spectrum
    }
}

/// Percent at the anchors of [`Spectrum::from_anchors`].
fn curve(percent: [f32; 11]) -> Spectrum {
    Spectrum::from_anchors(percent.map(|p| 0.01 * p))
}

/// As [`curve`], with the red edge of green leaves: chlorophyll absorbs up to 676 nm, then the reflectance rises by a
/// straight line to 750 nm (measured on all lawns and crowns of the Berlin library). The value at 700 nm is not used.
fn plant(percent: [f32; 11]) -> Spectrum {
    let anchors = curve(percent);
    let (low, high) = (anchors.at(650.0), anchors.at(750.0));
    Spectrum::from_fn(|nm| {
        if (650.0..750.0).contains(&nm) { low + (high - low) * ((nm - 676.0) / 74.0).max(0.0) } else { anchors.at(nm) }
    })
}

/// Percent in red, green and blue and in the infrared.
fn paint(percent: [f32; 3], infrared: f32) -> Spectrum {
    Spectrum::paint(percent.map(|p| 0.01 * p), 0.01 * infrared)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::Vec3;
    use std::collections::BTreeMap;

    #[test]
    fn every_reflectance_is_physical_and_every_texture_bounded() {
        for (number, material) in Material::ALL.iter().copied().enumerate() {
            assert_eq!(material as usize, number);
            let properties = material.properties();
            for nm in (400..=1000).step_by(10) {
                assert!((0.0..=0.95).contains(&properties.spectrum.at(nm as f32)), "{material:?} at {nm} nm");
            }
            for i in 0..500 {
                let p = Vec3::new(i as f32 * 0.13, i as f32 * -0.07, i as f32 * 0.019);
                let factor = properties.texture(&p, &Vec3::y());
                assert!((0.4..=1.6).contains(&factor), "{material:?}: {factor}");
            }
        }
    }

    /// Means of the Berlin library's samples by kind: names and reflectances at its wavelengths (nm).
    fn library(folder: &std::path::Path) -> (Vec<f32>, BTreeMap<String, Vec<f32>>) {
        let header = std::fs::read_to_string(folder.join("library_berlin.hdr")).expect("header");
        let list = |key: &str| -> Vec<String> {
            let from = header.find(&format!("\n{key} = {{")).expect("key") + key.len() + 5;
            header[from..].split('}').next().into_iter().flat_map(|l| l.split(',')).map(|v| v.trim().into()).collect()
        };
        let nm: Vec<f32> = list("wavelength").iter().map(|v| 1000.0 * v.parse::<f32>().expect("number")).collect();
        let bytes = std::fs::read(folder.join("library_berlin.sli")).expect("spectra");
        let values: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|v| f64::from_le_bytes(*v)).collect();
        let mut kinds: BTreeMap<String, Vec<Vec<f64>>> = BTreeMap::new();
        for (name, row) in list("spectra names").iter().zip(values.chunks_exact(nm.len())) {
            let kind = name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end();
            kinds.entry(kind.into()).or_default().push(row.to_vec());
        }
        let mean = |rows: Vec<Vec<f64>>| {
            let n = rows.len() as f64;
            (0..nm.len()).map(|i| (rows.iter().map(|r| r[i]).sum::<f64>() / n / 10_000.0) as f32).collect()
        };
        let kinds = kinds.into_iter().map(|(kind, rows)| (kind, mean(rows))).collect();
        (nm, kinds)
    }

    #[test]
    fn measured_curves_are_those_of_the_library() {
        let folder = std::env::var_os("REPLICA_DATA").map_or_else(
            || std::path::PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
            std::path::PathBuf::from,
        );
        let folder = folder.join("spectra/speclib_berlin_urban");
        if !folder.exists() {
            eprintln!("skipped: no {}", folder.display());
            return;
        }
        let (nm, kinds) = library(&folder);
        for (material, kind) in [
            (Material::AsphaltNew, "asphalt"),
            (Material::Concrete, "concrete"),
            (Material::Gravel, "concrete"),
            (Material::Ballast, "railtrack"),
            (Material::Soil, "bare soil"),
            (Material::Sand, "sand (playground)"),
            (Material::Grass, "grass (intensively manicured)"),
            (Material::DryGrass, "grass (dry)"),
            (Material::ClayTile, "red clay tile"),
            (Material::Slate, "black tile"),
            (Material::Bitumen, "bitumen"),
            (Material::Needles, "coniferous tree"),
        ] {
            let spectrum = material.spectrum();
            for (nm, value) in nm.iter().zip(&kinds[kind]).filter(|(nm, _)| **nm < 1000.0) {
                let off = spectrum.at(*nm) - value;
                assert!(off.abs() < 0.015, "{material:?} at {nm} nm: off by {off} from {value}");
            }
        }
    }

    #[test]
    fn leaves_have_the_red_edge_and_asphalt_has_not() {
        let rise = |m: Material| m.spectrum().at(780.0) / m.spectrum().at(660.0);
        assert!(rise(Material::Leaves) > 5.0 && rise(Material::Asphalt) < 1.3);
    }
}
