//! `replica fuse` on the shipped models.

use crate::support::{printed, replica, succeeded, text};
use std::path::{Path, PathBuf};

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name)
}

#[test]
fn command_of_the_model_card_writes_the_shipped_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("fused.safetensors");
    let (street, points) = (model("street.safetensors"), model("points.safetensors"));
    let arguments = ["fuse", text(&street), text(&points), "--share", "0.5", "--every", "3", "--out", text(&out)];
    succeeded(&replica(&arguments));
    let read = |path: &Path| std::fs::read(path).expect("is there");
    assert!(read(&out) == read(&model("street_fused.safetensors")));
}

#[test]
fn models_and_numbers_that_do_not_suit_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("fused.safetensors");
    let [street, ground, fused] =
        ["street", "ground", "street_fused"].map(|name| model(&format!("{name}.safetensors")));
    let without_file = folder.path().join("none.safetensors");
    for (first, share, code, rule) in [
        (
            &ground,
            "0.5",
            1,
            "ground.safetensors: metadata key `model`: the model knows no probabilities, so it cannot be fused",
        ),
        (&fused, "0.5", 1, "the model is fused itself, so it cannot be fused"),
        (&without_file, "0.5", 1, "none.safetensors: No such file"),
        (&street, "1.5", 2, "must be 0 to 1"),
    ] {
        let refused = replica(&["fuse", text(first), text(&street), "--share", share, "--out", text(&out)]);
        assert_eq!(refused.status.code(), Some(code), "{}", printed(&refused));
        assert!(printed(&refused).contains(rule), "{}", printed(&refused));
        assert!(!out.exists());
    }
}
