//! One file per subcommand: its arguments and what it does.

pub mod convert;
pub mod import;
pub mod inspect;
pub mod simulate;
