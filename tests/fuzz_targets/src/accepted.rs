//! Counts the inputs that a reader accepts, in tests: a seed that is refused at once would hide most of its reader from
//! fuzzing.

use std::cell::RefCell;
use std::fmt::Display;

thread_local!(static LAST: RefCell<Option<Result<(), String>>> = const { RefCell::new(None) });

/// Keeps the first result.
pub(crate) fn accepted<T, E: Display>(result: &Result<T, E>) {
    if cfg!(test) {
        let found = result.as_ref().map(|_| ()).map_err(ToString::to_string);
        LAST.with_borrow_mut(|last| {
            if !matches!(last, Some(Ok(()))) {
                *last = Some(found);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TARGETS;
    use crate::mutation::corpus_files;

    #[test]
    fn readers_accept_their_seeds() {
        let mut n_checked = 0;
        let mut refused = Vec::new();
        for (name, target) in TARGETS {
            for (file, bytes) in corpus_files(name).expect("a corpus") {
                if !file.starts_with("seed_") {
                    continue;
                }
                LAST.with_borrow_mut(|last| *last = None);
                target(&bytes);
                match LAST.with_borrow_mut(Option::take) {
                    Some(Ok(())) => n_checked += 1,
                    Some(Err(error)) => refused.push(format!("{name}/{file}: {error}")),
                    None => {}
                }
            }
        }
        assert!(refused.is_empty() && n_checked >= 60, "{n_checked} accepted\n{}", refused.join("\n"));
    }
}
