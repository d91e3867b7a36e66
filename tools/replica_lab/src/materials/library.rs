//! Reference spectra of libraries by material.

use crate::spectrum::reference;
use formats::envi::LibrarySpectrum;
use messages::MaterialId;
use std::collections::BTreeMap;
use std::path::Path;

/// Words in the names of a library, and the material. The first word that occurs counts.
const KINDS: [(&str, MaterialId); 22] = [
    ("artificial turf", MaterialId::Fabric),
    ("tartan", MaterialId::Fabric),
    ("polyethylene", MaterialId::Fabric),
    ("(dry", MaterialId::DryVegetation),
    ("tile", MaterialId::Brick),
    ("brick", MaterialId::Brick),
    ("bitumen", MaterialId::Asphalt),
    ("asphalt", MaterialId::Asphalt),
    ("concrete", MaterialId::Concrete),
    ("railtrack", MaterialId::Stone),
    ("grass", MaterialId::Vegetation),
    ("tree", MaterialId::Vegetation),
    ("acer", MaterialId::Vegetation),
    ("corn", MaterialId::Vegetation),
    ("potatoes", MaterialId::Vegetation),
    ("sorghum", MaterialId::Vegetation),
    ("sugarbeet", MaterialId::Vegetation),
    ("sunflower", MaterialId::Vegetation),
    ("soil", MaterialId::Soil),
    ("sand", MaterialId::Soil),
    ("water", MaterialId::Water),
    ("zinc", MaterialId::Metal),
];

/// A kind of surface.
pub struct SurfaceKind {
    pub name: String,
    pub material: MaterialId,
    /// Mean of its samples.
    pub reflectances: Vec<f32>,
}

/// A library of spectra.
pub struct Library {
    pub known: Vec<SurfaceKind>,
    /// Names without a material.
    pub others: Vec<String>,
}

/// Reads the kinds of a library at these wavelengths.
pub fn read(path: &Path, wavelengths_nm: &[f32]) -> anyhow::Result<Library> {
    let mut kinds = BTreeMap::<String, Vec<Vec<f64>>>::new();
    let mut others = Vec::new();
    for spectrum in reference::read(path)? {
        let kind = kind_of(&spectrum.name);
        match (material_of(kind), in_bands(&spectrum, wavelengths_nm)) {
            (Some(_), Some(values)) => kinds.entry(kind.to_owned()).or_default().push(values),
            _ => others.push(spectrum.name),
        }
    }
    let mean = |samples: &[Vec<f64>]| -> Vec<f32> {
        let sum = |band: usize| samples.iter().map(|values| values[band]).sum::<f64>();
        (0..wavelengths_nm.len()).map(|band| (sum(band) / samples.len() as f64) as f32).collect()
    };
    let known = kinds.iter().filter_map(|(kind, samples)| {
        Some(SurfaceKind { name: kind.clone(), material: material_of(kind)?, reflectances: mean(samples) })
    });
    Ok(Library { known: known.collect(), others })
}

/// The name without the number of the sample.
fn kind_of(name: &str) -> &str {
    name.trim_end_matches(|c: char| c.is_ascii_digit() || c.is_whitespace())
}

fn material_of(kind: &str) -> Option<MaterialId> {
    let kind = kind.to_lowercase();
    KINDS.iter().find(|(word, _)| kind.contains(word)).map(|(_, material)| *material)
}

fn in_bands(spectrum: &LibrarySpectrum, wavelengths_nm: &[f32]) -> Option<Vec<f64>> {
    wavelengths_nm.iter().map(|nm| reference::at(spectrum, *nm)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kind_and_material_follow_from_the_name_of_a_sample() {
        assert_eq!(kind_of("red clay tile 3"), "red clay tile");
        for (name, material) in [
            ("red clay tile", Some(MaterialId::Brick)),
            ("grass (dry agricultural grassland)", Some(MaterialId::DryVegetation)),
            ("artificial turf", Some(MaterialId::Fabric)),
            ("Acer rubrum", Some(MaterialId::Vegetation)),
            ("greenish roof material (unknown)", None),
        ] {
            assert_eq!(material_of(name), material, "{name}");
        }
    }
}
