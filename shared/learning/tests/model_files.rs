//! Which files are taken for models, and what is said about the others.

mod support;

use learning::ground::Parameters;
use learning::{Cloud, LearningError};
use messages::{ClassRow, SubmapHeader, SubmapPoint};
use std::path::PathBuf;
use support::{model_of, shipped_model};

/// The outcome of loading these bytes as a file.
fn refused(bytes: &[u8]) -> LearningError {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.safetensors");
    std::fs::write(&path, bytes).expect("writes");
    match learning::load(&path, &learning::Options::default()) {
        Ok(_) => panic!("was loaded"),
        Err(error) => {
            assert!(error.to_string().contains("model.safetensors"), "no file name in: {error}");
            error
        }
    }
}

/// The shipped model with one word of its JSON header replaced by another of the same length.
fn edited(from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = Parameters::default().to_bytes().expect("encodes");
    let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).expect("stands in the header");
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn the_shipped_model_is_what_the_program_writes() {
    let bytes = std::fs::read(shipped_model()).expect("models/ground.safetensors is part of the project");
    assert_eq!(bytes, Parameters::default().to_bytes().expect("encodes"));
    assert!(bytes.len() < 10_000);
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    assert_eq!((model.card().architecture.as_str(), model.card().version), ("ground_quasi_flat", 2));
    assert_ne!(model.card().digest, 0);
}

#[test]
fn another_parameter_gives_another_digest() {
    let mut parameters = Parameters::default();
    let digest = model_of(&parameters).card().digest;
    parameters.tolerance_m[1] = 0.16;
    assert_ne!(model_of(&parameters).card().digest, digest);
}

#[test]
fn a_file_that_is_cut_anywhere_is_refused() {
    let bytes = Parameters::default().to_bytes().expect("encodes");
    for len in 0..bytes.len() {
        assert!(matches!(refused(&bytes[..len]), LearningError::Container { .. }), "cut at {len}");
    }
}

#[test]
fn foreign_architectures_versions_and_cards_are_refused_by_name() {
    let error = refused(&edited("ground_quasi_flat", "ground_quasi_flax"));
    assert!(matches!(&error, LearningError::Architecture { got, .. } if got == "ground_quasi_flax"), "{error}");
    let error = refused(&edited("\\\"version\\\":2", "\\\"version\\\":7"));
    assert!(matches!(error, LearningError::Version { got: 7, expected: 2, .. }), "{error}");
    assert!(matches!(refused(&edited("\"model\"", "\"mudel\"")), LearningError::Card { .. }));
    let error = refused(&edited("low_m", "low_x"));
    assert!(matches!(&error, LearningError::Card { reason, .. } if reason.contains("low_x")), "{error}");
}

#[test]
fn tensors_of_wrong_name_type_or_size_are_refused_by_name() {
    let error = refused(&edited("tolerance_m", "tolerance_x"));
    assert!(matches!(&error, LearningError::Tensor { name, .. } if name == "tolerance_m"), "{error}");
    let error = refused(&edited("F32", "I32"));
    assert!(matches!(error, LearningError::Tensor { .. }), "{error}");
    let too_many = Parameters { steps_m: vec![0.1; 257], ..Parameters::default() };
    let error = refused(&too_many.to_bytes().expect("encodes"));
    assert!(error.to_string().contains("257 elements, expected 1 to 256"), "{error}");
    for steps_m in [vec![], vec![0.1, f32::NAN], vec![0.1, -0.2]] {
        let error = refused(&Parameters { steps_m, ..Parameters::default() }.to_bytes().expect("encodes"));
        assert!(matches!(&error, LearningError::Tensor { name, .. } if name == "steps_m"), "{error}");
    }
}

#[test]
fn settings_outside_their_range_are_refused_by_key() {
    let mut parameters = Parameters::default();
    parameters.settings.cell_m = 0.001;
    let error = refused(&parameters.to_bytes().expect("encodes"));
    assert!(matches!(error, LearningError::Setting { key: "cell_m", .. }), "{error}");
    assert!(error.to_string().contains("must be between 0.02 and 2"), "{error}");
}

#[test]
fn an_absent_file_and_columns_of_wrong_length_are_errors() {
    let absent = PathBuf::from("/nowhere/model.safetensors");
    assert!(matches!(learning::load(&absent, &learning::Options::default()), Err(LearningError::Io { .. })));
    let model = learning::load(&shipped_model(), &learning::Options::default()).expect("loads");
    let header = SubmapHeader::default();
    let cloud = Cloud { header: &header, points: &[SubmapPoint::default(); 3], colors: None };
    let outcome = model.segment(&cloud, &mut [ClassRow::default(); 2]);
    assert!(matches!(outcome, Err(LearningError::Length { got: 2, expected: 3, .. })));
    let cloud = Cloud { colors: Some(&[]), ..cloud };
    assert!(model.segment(&cloud, &mut [ClassRow::default(); 3]).is_err());
}
