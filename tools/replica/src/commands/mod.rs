//! One file per subcommand: its arguments and what it does.

pub mod bench;
pub mod compare;
pub mod convert;
pub mod echo;
pub mod evaluate;
pub mod hz;
pub mod import;
pub mod inspect;
pub mod instances;
pub mod record;
pub mod replay;
pub mod send;
pub mod simulate;
pub mod spectrum;
pub mod status;
pub mod stop;
pub mod swap;
pub mod topics;
pub mod train;
