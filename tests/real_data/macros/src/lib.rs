//! The attribute behind `real_data::test`. An attribute macro needs a crate of its own.

mod presence;

use proc_macro::{Literal, TokenStream, TokenTree};
use std::path::{Path, PathBuf};

/// See `real_data::test`.
#[proc_macro_attribute]
pub fn test(names: TokenStream, function: TokenStream) -> TokenStream {
    let mut wanted = Vec::new();
    for token in names {
        match token {
            TokenTree::Literal(literal) => {
                let text = literal.to_string();
                match text.strip_prefix('"').and_then(|text| text.strip_suffix('"')) {
                    Some(name) => wanted.push(name.to_owned()),
                    None => return error(&format!("expected the path of a file or folder as a string, found {text}")),
                }
            }
            TokenTree::Punct(punct) if punct.as_char() == ',' => {}
            other => return error(&format!("expected \"path\", \"path\", …, found {other}")),
        }
    }
    if wanted.is_empty() {
        return error("name the files or folders that the test reads: #[real_data::test(\"kitti00/000094.bin\")]");
    }
    let mut attributes = "#[::core::prelude::v1::test]".to_owned();
    let setting = std::env::var("REPLICA_DATA").ok();
    if setting.as_deref() != Some("required") {
        let folder = setting.map_or_else(default_folder, PathBuf::from);
        let absent: Result<Vec<_>, _> = wanted.iter().map(|name| presence::absent(&folder, name)).collect();
        let absent: Vec<String> = match absent {
            Ok(absent) => absent.into_iter().flatten().collect(),
            Err(problem) => return error(&problem),
        };
        if !absent.is_empty() {
            let reason = Literal::string(&format!("real data is absent: {}", absent.join(", ")));
            attributes = format!("{attributes}#[ignore = {reason}]");
        }
    }
    // Cargo registers that the crate reads the variable, and compiles the test again when it changes.
    let tracked = "const _: Option<&str> = option_env!(\"REPLICA_DATA\");";
    let mut output: TokenStream = format!("{tracked}{attributes}").parse().expect("the text is valid Rust");
    output.extend(function);
    output
}

/// `../shared/data` next to the project.
fn default_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/data")
}

fn error(message: &str) -> TokenStream {
    format!("compile_error!({});", Literal::string(message)).parse().expect("a macro call is valid tokens")
}
