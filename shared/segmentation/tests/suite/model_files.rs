//! Model files: accepted files, and the errors of rejected ones.

use crate::support::{model_of, shipped_model};
use ground::Parameters;
use messages::{ClassRow, SubmapHeader, SubmapPoint};
use segmentation::ground_quasi_flat::encode;
use segmentation::{ModelInput, SegmentationError};
use std::path::PathBuf;

/// The error of loading these bytes as a file.
fn rejected(bytes: &[u8]) -> SegmentationError {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("model.safetensors");
    std::fs::write(&path, bytes).expect("writes");
    match segmentation::load(&path, &segmentation::Options::default()) {
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
    let mut bytes = encode(&Parameters::default()).expect("encodes");
    let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).expect("stands in the header");
    bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
    bytes
}

#[test]
fn shipped_model_equals_default_parameters() {
    let bytes = std::fs::read(shipped_model()).expect("models/ground.safetensors is part of the project");
    assert_eq!(bytes, encode(&Parameters::default()).expect("encodes"));
    assert!(bytes.len() < 10_000);
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    assert_eq!((model.card().architecture.as_str(), model.card().version), ("ground_quasi_flat", 4));
    assert_ne!(model.card().digest, 0);
}

#[test]
fn digest_changes_with_parameter() {
    let mut parameters = Parameters::default();
    let digest = model_of(&parameters).card().digest;
    parameters.tolerance.above_m = 0.16;
    assert_ne!(model_of(&parameters).card().digest, digest);
}

#[test]
fn truncated_file_is_rejected() {
    let bytes = encode(&Parameters::default()).expect("encodes");
    for len in 0..bytes.len() {
        assert!(matches!(rejected(&bytes[..len]), SegmentationError::Container { .. }), "cut at {len}");
    }
}

#[test]
fn unknown_architecture_version_and_card_are_rejected() {
    let error = rejected(&edited("ground_quasi_flat", "ground_quasi_flax"));
    assert!(matches!(&error, SegmentationError::Architecture { found, .. } if found == "ground_quasi_flax"), "{error}");
    let error = rejected(&edited("\\\"version\\\":4", "\\\"version\\\":7"));
    assert!(matches!(error, SegmentationError::Version { found: 7, expected: 4, .. }), "{error}");
    assert!(matches!(rejected(&edited("\"model\"", "\"mudel\"")), SegmentationError::Card { .. }));
    let error = rejected(&edited("low_m", "low_x"));
    assert!(matches!(&error, SegmentationError::Card { reason, .. } if reason.contains("low_x")), "{error}");
}

#[test]
fn invalid_tensors_are_rejected_by_name() {
    let error = rejected(&edited("tolerance_m", "tolerance_x"));
    assert!(matches!(&error, SegmentationError::Tensor { name, .. } if name == "tolerance_m"), "{error}");
    let error = rejected(&edited("F32", "I32"));
    assert!(matches!(error, SegmentationError::Tensor { .. }), "{error}");
    let too_many = Parameters { steps_m: vec![0.1; 257], ..Parameters::default() };
    let error = rejected(&encode(&too_many).expect("encodes"));
    assert!(error.to_string().contains("257 elements, expected 1 to 256"), "{error}");
    for steps_m in [vec![], vec![0.1, f32::NAN], vec![0.1, -0.2]] {
        let error = rejected(&encode(&Parameters { steps_m, ..Parameters::default() }).expect("encodes"));
        assert!(matches!(&error, SegmentationError::Tensor { name, .. } if name == "steps_m"), "{error}");
    }
}

#[test]
fn settings_out_of_range_are_rejected_by_key() {
    let mut parameters = Parameters::default();
    parameters.settings.cell_m = 0.001;
    let error = rejected(&encode(&parameters).expect("encodes"));
    assert!(matches!(error, SegmentationError::Setting { key: "cell_m", .. }), "{error}");
    assert!(error.to_string().contains("must be between 0.02 and 2"), "{error}");
}

#[test]
fn missing_file_and_columns_of_wrong_length_are_errors() {
    let absent = PathBuf::from("/nowhere/model.safetensors");
    assert!(matches!(
        segmentation::load(&absent, &segmentation::Options::default()),
        Err(SegmentationError::Io { .. })
    ));
    let model = segmentation::load(&shipped_model(), &segmentation::Options::default()).expect("loads");
    let header = SubmapHeader::default();
    let points = [SubmapPoint::default(); 3];
    let cloud = ModelInput::new(&header, &points);
    let outcome = model.segment(&cloud, &mut [ClassRow::default(); 2]);
    assert!(matches!(outcome, Err(SegmentationError::Length { found: 2, expected: 3, .. })));
    let cloud = ModelInput { colors: Some(&[]), ..cloud };
    assert!(model.segment(&cloud, &mut [ClassRow::default(); 3]).is_err());
}
