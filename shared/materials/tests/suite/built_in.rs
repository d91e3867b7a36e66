//! The built-in model.

use materials::{Classifier, Method, Model, N_MATERIALS, Places, Smoothing, Spectra, best_row, materials_of};
use messages::MaterialId;

#[test]
fn built_in_model_has_references_of_every_material() {
    let model = Model::built_in().expect("sound");
    for id in MaterialId::ALL.iter().skip(1) {
        assert!((0..model.references.len()).any(|i| model.material(i) == *id), "{id:?}");
    }
    let text = model.to_json();
    assert_eq!(Model::from_json(&text).expect("reads what it writes"), model);
}

#[test]
fn clear_spectra_get_their_material_in_any_brightness() {
    let model = Model::built_in().expect("sound");
    let of =
        |name: &str| model.references.iter().find(|r| r.name == name).expect("a reference").log_reflectance.clone();
    for (name, material) in [("Leaves", MaterialId::Vegetation), ("Brick", MaterialId::Brick)] {
        for method in Method::ALL {
            for factor in [0.7, 1.0] {
                let mut spectra = Spectra::new(&model.wavelengths_nm);
                let values: Vec<f32> = of(name).iter().map(|log| log.exp() * factor).collect();
                spectra.push(u64::MAX >> (64 - values.len()), &values);
                let found = Classifier::new(&model, &model.wavelengths_nm, method).classify(&spectra);
                let row = best_row(&found[0]);
                assert_eq!(row.material_id, material as u8, "{name} by {} at {factor}", method.name());
            }
        }
    }
}

#[test]
fn spectrum_of_one_camera_or_none_is_handled() {
    let model = Model::built_in().expect("sound");
    let leaves = model.references.iter().find(|r| r.name == "Leaves").expect("a reference");
    let values: Vec<f32> = leaves.log_reflectance.iter().map(|log| log.exp()).collect();
    let mut spectra = Spectra::new(&model.wavelengths_nm);
    let infrared = model.wavelengths_nm.iter().enumerate().filter(|(_, nm)| **nm > 650.0);
    spectra.push(infrared.fold(0, |bits, (band, _)| bits | 1 << band), &values);
    spectra.push(0b111, &values);
    let classifier = Classifier::new(&model, &model.wavelengths_nm, Method::Learned);
    let places = Places { positions: &[[0.0; 3], [50.0, 0.0, 0.0]], regions: None };
    let found = materials_of(&classifier, &spectra, places, Smoothing::Off);
    assert_eq!(best_row(&found[0]).material_id, MaterialId::Vegetation as u8, "infrared bands alone identify leaves");
    assert_eq!(found[1], [0.0; N_MATERIALS], "three bands are too few");
    assert_eq!((best_row(&found[1]).material_id, best_row(&found[1]).score), (MaterialId::Unknown as u8, 0));
}

#[test]
fn spectrum_that_fits_no_reference_is_unknown() {
    let model = Model::built_in().expect("sound");
    let mut spectra = Spectra::new(&model.wavelengths_nm);
    let stripes: Vec<f32> =
        (0..model.wavelengths_nm.len()).map(|band| if band % 2 == 0 { 0.9 } else { 0.01 }).collect();
    spectra.push(u64::MAX >> (64 - stripes.len()), &stripes);
    let found = Classifier::new(&model, &model.wavelengths_nm, Method::Learned).classify(&spectra);
    assert_eq!(best_row(&found[0]).material_id, MaterialId::Unknown as u8);
}

#[test]
fn damaged_model_is_refused_with_place_and_rule() {
    let model = Model::built_in().expect("sound");
    let text = |change: fn(&mut Model)| {
        let mut model = model.clone();
        change(&mut model);
        Model::from_json(&model.to_json()).expect_err("refused").to_string()
    };
    let unknown = text(|model| "stnoe".clone_into(&mut model.references[0].material));
    assert!(
        unknown.contains("\"stnoe\"") || unknown.contains("value stnoe must be the name of a material"),
        "{unknown}"
    );
    let short = text(|model| model.lights[1].covariance.truncate(665));
    assert!(short.starts_with("covariance: value 665 must be the upper triangle"), "{short}");
    let flat = text(|model| model.references[3].share = 0.0);
    assert!(flat.contains("must be above 0, at most 1"), "{flat}");
}
