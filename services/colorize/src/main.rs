//! The process of the stage colorize.
fn main() -> std::process::ExitCode {
    stage::run::<colorize::Colorize>()
}
