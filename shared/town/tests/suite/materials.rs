//! Reflectance spectra and textures of the materials.

use messages::MaterialId;
use raytrace::Vec3;
use std::collections::BTreeMap;
use std::path::Path;
use town::Material;

#[test]
fn reflectances_are_physical_and_textures_bounded() {
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

/// Means of the samples of the Berlin library by kind: names and reflectances at its wavelengths (nm).
fn library(folder: &Path) -> (Vec<f32>, BTreeMap<String, Vec<f32>>) {
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

#[real_data::test("spectra/speclib_berlin_urban")]
fn measured_materials_follow_the_spectral_library() {
    let (nm, kinds) = library(&real_data::path("spectra/speclib_berlin_urban"));
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
    ] {
        let spectrum = material.spectrum();
        for (nm, value) in nm.iter().zip(&kinds[kind]).filter(|(nm, _)| **nm < 1000.0) {
            let off = spectrum.at(*nm) - value;
            assert!(off.abs() < 0.015, "{material:?} at {nm} nm: off by {off} from {value}");
        }
    }
}

#[test]
fn leaves_have_the_red_edge_and_asphalt_does_not() {
    let rise = |m: Material| m.spectrum().at(780.0) / m.spectrum().at(660.0);
    assert!(rise(Material::Leaves) > 5.0 && rise(Material::Asphalt) < 1.3);
}

#[test]
fn every_material_id_but_unknown_has_a_material_in_the_towns() {
    for id in MaterialId::ALL.iter().skip(1) {
        assert!(Material::ALL.iter().any(|material| material.id() == Some(*id)), "{id:?}");
    }
    assert!(Material::ALL.iter().all(|material| material.id() != Some(MaterialId::Unknown)));
    assert_eq!(Material::SkinLight.id(), None);
}
