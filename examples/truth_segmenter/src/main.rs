//! Process of the stage.
fn main() -> std::process::ExitCode {
    stage::run::<truth_segmenter::TruthSegmenter>()
}
