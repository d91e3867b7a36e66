//! Process of the stage.
fn main() -> std::process::ExitCode {
    stage::run::<replay::Replay>()
}
