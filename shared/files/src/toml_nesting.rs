//! A limit on nested brackets in TOML, checked before a text is parsed.
//!
//! The parser also has a limit, but miscounts some invalid texts: `{[]x=` 8000 times overflows the stack.

use toml_parser::Source;
use toml_parser::lexer::TokenKind;

/// Maximum number of levels of arrays and inline tables. The parser has a limit of 80.
const MAX_LEVELS: usize = 100;

/// Error of brackets that are nested too deeply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than {MAX_LEVELS} arrays and inline tables are open here")]
pub struct TooDeep {
    /// Byte offset of the bracket.
    pub at: usize,
}

/// Checks that brackets are not nested too deeply. A closing bracket closes only the last open one.
pub fn check_nesting(text: &str) -> Result<(), TooDeep> {
    let mut open = Vec::new();
    for token in Source::new(text).lex() {
        let opened_by = match token.kind() {
            kind @ (TokenKind::LeftSquareBracket | TokenKind::LeftCurlyBracket) => {
                open.push(kind);
                if open.len() > MAX_LEVELS {
                    return Err(TooDeep { at: token.span().start() });
                }
                continue;
            }
            TokenKind::RightSquareBracket => TokenKind::LeftSquareBracket,
            TokenKind::RightCurlyBracket => TokenKind::LeftCurlyBracket,
            _ => continue,
        };
        open.pop_if(|last| *last == opened_by);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_that_are_not_closed_in_their_order_are_counted() {
        assert_eq!(check_nesting(&"x = [{a = 1}]\n[b]\n[[c]]\n".repeat(1000)), Ok(()));
        let texts = "# [0, 1)\ny = ['[', \"{\\\"[\", '''\n[''']\n".repeat(1000);
        assert_eq!(check_nesting(&texts), Ok(()), "brackets in texts and comments");
        assert_eq!(check_nesting(&"[".repeat(100)), Ok(()));
        assert_eq!(check_nesting(&"[".repeat(101)), Err(TooDeep { at: 100 }));
        assert!(check_nesting(&"{[]x=".repeat(101)).is_err());
    }
}
