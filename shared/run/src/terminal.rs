//! Text on terminals: characters that a terminal prints, and screens that are redrawn with their size, lines that fit and
//! colors.

use rustix::termios::tcgetwinsize;
use std::borrow::Cow;
use std::io::IsTerminal;
use std::os::fd::AsFd;

/// Size assumed for a terminal that does not report one: the smallest that every screen fits.
const DEFAULT_SIZE: [usize; 2] = [80, 24];

/// Lines and columns of a terminal, and whether it shows colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Screen {
    /// Characters of a line.
    pub columns: usize,
    /// Lines.
    pub rows: usize,
    /// False if `NO_COLOR` is set or the terminal is dumb.
    pub has_colors: bool,
}

/// Emphasis of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Headings.
    Bold,
    /// Warnings, and the stage that the other stages wait for.
    Yellow,
    /// Errors.
    Red,
}

impl Screen {
    /// The current terminal behind an output, because windows change; `None` if it is a file or a pipe.
    pub fn from_output(output: &(impl AsFd + IsTerminal)) -> Option<Self> {
        if !output.is_terminal() {
            return None;
        }
        let size = tcgetwinsize(output).ok().map(|size| [size.ws_col, size.ws_row].map(usize::from));
        let [columns, rows] = size.filter(|size| !size.contains(&0)).unwrap_or(DEFAULT_SIZE);
        let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let is_dumb = std::env::var_os("TERM").is_none_or(|term| term == "dumb");
        Some(Self { columns, rows, has_colors: !is_set("NO_COLOR") && !is_dumb })
    }

    /// The line with this emphasis, cut to the width of the terminal: a line that wraps would spoil the next redraw.
    pub fn line(self, text: &str, style: Option<Style>) -> String {
        let text = clip(&printable(text), self.columns);
        let code = match style.filter(|_| self.has_colors) {
            None => return text,
            Some(Style::Bold) => 1,
            Some(Style::Yellow) => 33,
            Some(Style::Red) => 31,
        };
        format!("\x1b[{code}m{text}\x1b[0m")
    }
}

/// The text with escapes such as `\u{1b}` in place of characters that control a terminal or reverse the direction of
/// writing; lines and tabs stay. Names of files, drives and sessions may come from third parties.
pub fn printable(text: &str) -> Cow<'_, str> {
    let is_harmless = |c: char| !(c.is_control() || reverses_direction(c)) || c == '\n' || c == '\t';
    if text.chars().all(is_harmless) {
        return Cow::Borrowed(text);
    }
    let escaped = text.chars().map(|c| if is_harmless(c) { c.to_string() } else { c.escape_unicode().to_string() });
    Cow::Owned(escaped.collect())
}

/// Embeddings, overrides and isolates of the Unicode bidirectional algorithm.
fn reverses_direction(c: char) -> bool {
    matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// The first characters of a text, with `…` in place of the rest.
pub fn clip(text: &str, columns: usize) -> String {
    if text.chars().count() <= columns {
        return text.to_owned();
    }
    text.chars().take(columns.saturating_sub(1)).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_is_no_screen() {
        assert_eq!(Screen::from_output(&tempfile::tempfile().expect("a file")), None);
    }

    #[test]
    fn characters_that_control_a_terminal_are_escaped() {
        assert_eq!(printable("Straße\t1\nläuft"), "Straße\t1\nläuft");
        assert_eq!(printable("a\x1b[2J\rb"), "a\\u{1b}[2J\\u{d}b");
        assert_eq!(printable("\u{9b}31m \u{202e}gpj.exe"), "\\u{9b}31m \\u{202e}gpj.exe");
        let screen = Screen { columns: 40, rows: 24, has_colors: false };
        assert_eq!(screen.line("\x1b]0;title", None), "\\u{1b}]0;title");
    }

    #[test]
    fn line_is_cut_to_the_width_and_colored_only_with_colors() {
        let plain = Screen { columns: 6, rows: 24, has_colors: false };
        assert_eq!(plain.line("abcdefgh", Some(Style::Red)), "abcde…");
        assert_eq!(plain.line("abcdef", None), "abcdef");
        let colored = Screen { has_colors: true, ..plain };
        assert_eq!(colored.line("abcdefgh", Some(Style::Red)), "\x1b[31mabcde…\x1b[0m");
        assert_eq!(colored.line("a", None), "a");
    }
}
