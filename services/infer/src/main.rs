//! The process of the stage infer.
fn main() -> std::process::ExitCode {
    stage::run::<infer::Infer>()
}
