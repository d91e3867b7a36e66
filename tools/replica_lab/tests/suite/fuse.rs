//! `replica-lab fuse` on the shipped models.

use crate::support::{printed, replica_lab, succeeded, text};
use std::path::{Path, PathBuf};

fn model(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../models").join(name)
}

#[test]
fn command_of_the_model_card_writes_the_shipped_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("fused.safetensors");
    let street = model("street_simulated.safetensors");
    let points = model("points_simulated.safetensors");
    let priors =
        "bridge=4.95,guard-rail=1.82,pedestrian=1.11,static=5.47,terrain=1.35,traffic-light=2.72,traffic-sign=2.46";
    let settings = ["--share", "0.5", "--every", "3", "--temperature", "0.75", "--priors", priors];
    succeeded(&replica_lab(&[&["fuse", text(&street), text(&points), "--out", text(&out)], &settings[..]].concat()));
    let read = |path: &Path| std::fs::read(path).expect("is there");
    assert!(read(&out) == read(&model("street_fused.safetensors")));
}

#[test]
fn fitted_priors_are_printed_as_the_command_takes_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let street = model("street.safetensors");
    let points = model("points.safetensors");
    let [recipe, fitted, given] = ["recipe.toml", "fitted.safetensors", "given.safetensors"].map(path);
    let group = "[[group]]\ntowns = ['urban']\nseeds = { first = 1, last = 1 }\nsensors = ['rig']\nintensity = 'auto'\n\
                 seconds = 2.0\nsubmaps = 1\nsweeps = 2\n";
    std::fs::write(&recipe, group).expect("writes");
    let fuse = |more: &[&str], out: &Path| {
        succeeded(&replica_lab(&[&["fuse", text(&street), text(&points), "--out", text(out)], more].concat()))
    };
    let printed = fuse(&["--fit-priors", text(&recipe)], &fitted);
    let priors = printed.lines().find_map(|line| line.strip_prefix("--priors ")).expect("some classes gain");
    assert!(printed.starts_with("group 1: mIoU "), "{printed}");
    fuse(&["--priors", priors], &given);
    let read = |path: &Path| std::fs::read(path).expect("is there");
    assert!(read(&given) == read(&fitted));
    fuse(&[], &given);
    assert!(read(&given) != read(&fitted));
    let printed = fuse(&["--fit-priors", text(&recipe), "--temperature", "0.5"], &given);
    assert!(
        printed.lines().any(|line| line.strip_prefix("--priors ") == Some(priors)),
        "of any temperature: {printed}"
    );
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
            "ground.safetensors: metadata key `model`: the model has no probabilities, so it cannot be fused",
        ),
        (&fused, "0.5", 1, "the model is itself fused, so it cannot be fused"),
        (&without_file, "0.5", 1, "none.safetensors: No such file"),
        (&street, "1.5", 2, "must be 0 to 1"),
    ] {
        let refused = replica_lab(&["fuse", text(first), text(&street), "--share", share, "--out", text(&out)]);
        assert_eq!(refused.status.code(), Some(code), "{}", printed(&refused));
        assert!(printed(&refused).contains(rule), "{}", printed(&refused));
        assert!(!out.exists());
    }
    let points = model("points.safetensors");
    for (option, value, code, rule) in [
        ("--temperature", "0", 1, "temperature = 0, must be 0.1 to 10"),
        ("--temperature", "nan", 1, "temperature = NaN, must be 0.1 to 10"),
        ("--priors", "poles=2", 1, "priors: unknown class \"poles\"; known are building, fence"),
        ("--priors", "pole=0", 1, "priors: pole = 0, must be 0.01 to 100"),
        ("--priors", "pole=2,pole=3", 1, "--priors: pole is given twice"),
        ("--priors", "pole", 2, "must be a class and a factor, as in bridge=4.5"),
    ] {
        let refused = replica_lab(&["fuse", text(&street), text(&points), option, value, "--out", text(&out)]);
        assert_eq!(refused.status.code(), Some(code), "{}", printed(&refused));
        assert!(printed(&refused).contains(rule), "{}", printed(&refused));
        assert!(!out.exists());
    }
}
