//! A pseudo-terminal, and the screen that a person would see.

use crate::TIMEOUT;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::time::Instant;

/// Both ends of a pseudo-terminal.
pub struct Terminal {
    /// The program's end.
    pub program: File,
    screen: File,
    size: [usize; 2],
    /// Bytes read so far.
    bytes: Vec<u8>,
}

impl Terminal {
    /// A terminal of this many columns and rows.
    pub fn new(columns: usize, rows: usize) -> Self {
        let screen = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
        grantpt(&screen).expect("granted");
        unlockpt(&screen).expect("unlocked");
        let size = Winsize { ws_col: columns as u16, ws_row: rows as u16, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(&screen, size).expect("sized");
        let name = ptsname(&screen, Vec::new()).expect("a name");
        let path = std::path::Path::new(std::ffi::OsStr::from_bytes(name.as_bytes()));
        let program = File::options().read(true).write(true).open(path).expect("opens");
        Self { program, screen: screen.into(), size: [columns, rows], bytes: Vec::new() }
    }

    /// Reads until `words` were written `n` times.
    ///
    /// # Panics
    /// If the programs stop writing, or do not write these words within three minutes.
    pub fn read_until(&mut self, words: &str, n: usize) {
        let begun = Instant::now();
        while self.written().matches(words).count() < n {
            assert!(begun.elapsed() < TIMEOUT, "{words:?} is not there {n} times: {}", self.written());
            let mut ready = [PollFd::new(&self.screen, PollFlags::IN)];
            let a_second = Timespec { tv_sec: 1, tv_nsec: 0 };
            if poll(&mut ready, Some(&a_second)).expect("a file that can be polled") > 0 {
                let mut buffer = [0; 4096];
                let n_read = self.screen.read(&mut buffer).unwrap_or(0);
                assert!(n_read > 0, "the programs ended; {words:?} is not there {n} times: {}", self.written());
                self.bytes.extend_from_slice(&buffer[..n_read]);
            }
        }
    }

    fn written(&self) -> String {
        String::from_utf8_lossy(&self.bytes).into_owned()
    }

    /// Reads until all programs have closed their end. Call it while they run: they wait for a reader.
    pub fn read_to_end(self) -> Screen {
        let Self { program, mut screen, size: [columns, rows], mut bytes } = self;
        drop(program);
        let mut buffer = [0; 4096];
        // Linux reports an error, not an end, when the last program has closed its end.
        while let Ok(n @ 1..) = screen.read(&mut buffer) {
            bytes.extend_from_slice(&buffer[..n]);
        }
        Screen::render(String::from_utf8_lossy(&bytes).into_owned(), columns, rows)
    }
}

/// The written bytes, and the lines on the screen and above it.
pub struct Screen {
    /// All bytes as text.
    pub written: String,
    /// Lines at the end, the oldest first.
    pub lines: Vec<String>,
}

impl Screen {
    /// Draws the output of programs of the project: text, colors, `ESC [ n A` (up) and `ESC [ J` (clear below).
    fn render(written: String, columns: usize, rows: usize) -> Self {
        let mut lines: Vec<Vec<char>> = vec![Vec::new()];
        let [mut row, mut column] = [0, 0];
        let mut characters = written.chars();
        while let Some(character) = characters.next() {
            match character {
                '\r' => column = 0,
                '\n' => {
                    row += 1;
                    lines.resize(lines.len().max(row + 1), Vec::new());
                }
                '\x1b' => match control_sequence(&mut characters) {
                    // The cursor does not leave the screen.
                    ('A', n) => row = row.saturating_sub(n).max(lines.len().saturating_sub(rows)),
                    ('J', _) => {
                        lines.truncate(row + 1);
                        lines[row].truncate(column);
                    }
                    ('m', _) => {}
                    other => panic!("unknown control sequence {other:?}"),
                },
                character => {
                    if column == columns {
                        row += 1;
                        column = 0;
                        lines.resize(lines.len().max(row + 1), Vec::new());
                    }
                    let line = &mut lines[row];
                    line.resize(line.len().max(column + 1), ' ');
                    line[column] = character;
                    column += 1;
                }
            }
        }
        let lines = lines.into_iter().map(|line| line.into_iter().collect()).collect();
        Self { written, lines }
    }

    /// Numbers of the lines that start with these words.
    pub fn find(&self, words: &str) -> Vec<usize> {
        (0..self.lines.len()).filter(|index| self.lines[*index].starts_with(words)).collect()
    }
}

/// Reads a control sequence `[ n letter`: the letter, and n or 1.
fn control_sequence(characters: &mut std::str::Chars<'_>) -> (char, usize) {
    let mut number = String::new();
    for character in characters.by_ref().skip_while(|character| *character == '[') {
        if character.is_ascii_alphabetic() {
            return (character, number.parse().unwrap_or(1));
        }
        number.push(character);
    }
    ('\0', 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn redrawn_lines_replace_the_old_ones() {
        let screen = Screen::render("a\r\nbb\r\n\x1b[1A\x1b[J\x1b[33mc\x1b[0m\r\n".to_owned(), 80, 24);
        assert_eq!(screen.lines, ["a", "c", ""]);
    }

    #[test]
    fn wrapped_line_takes_two() {
        assert_eq!(Screen::render("abc\r\n".to_owned(), 2, 24).lines, ["ab", "c", ""]);
    }
}
