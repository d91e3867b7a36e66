//! A program that replaces infer: `[infer] program = "…/height-segmenter"` in launch.toml.
fn main() -> std::process::ExitCode {
    stage::run::<height_segmenter::HeightSegmenter>()
}
