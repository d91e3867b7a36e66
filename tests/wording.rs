//! Wordings that readers stumble over do not come back into comments, messages, names and pages.

use super::files;
use std::path::Path;

/// A phrase that is not written, word by word with alternatives.
struct Phrase {
    words: &'static [&'static [&'static str]],
    /// Words before or after the phrase with which it is good English.
    fine_after: &'static [&'static str],
    fine_before: &'static [&'static str],
    instead: &'static str,
}

const fn phrase(words: &'static [&'static [&'static str]], instead: &'static str) -> Phrase {
    Phrase { words, fine_after: &[], fine_before: &[], instead }
}

const PHRASES: [Phrase; 12] = [
    phrase(&[&["that", "those"], &["of"]], "repeat the noun"),
    phrase(&[&["beside"]], "next to, in addition to, compared with"),
    Phrase {
        words: &[&["tell", "tells", "telling", "told"]],
        fine_after: &[],
        // The method of a file.
        fine_before: &["("],
        instead: "show, report, distinguish, determine",
    },
    phrase(
        &[&["the", "its", "their", "a", "each", "every", "this", "from", "at", "new"], &["begin"]],
        "start, beginning",
    ),
    Phrase {
        words: &[&["is", "are", "was", "were"], &["no"]],
        fine_after: &["there", "here"],
        fine_before: &["longer", "more", "less", "later", "fewer", "larger", "smaller", "further"],
        instead: "is not a",
    },
    phrase(&[&["is", "are", "was", "were"], &["none"]], "is invalid, is absent"),
    phrase(&[&["has", "have", "had", "having"], &["none"]], "name what is missing"),
    phrase(&[&["the", "its", "their", "own"], &["way"]], "along-track, route, track, in transit"),
    phrase(&[&["of", "by", "from", "for"], &["others"]], "third-party, other users, other programs"),
    phrase(&[&[","], &["too"], &[".", ",", ";", ":", ")"]], "also"),
    phrase(&[&["as"], &["far"], &["as"]], "up to"),
    phrase(&[&["fn"], &["of_*"]], "from_, per_, to_, or the noun"),
];

/// Words with which no documentation begins: it is read alone, without the line or the name above it.
const FRAGMENTS: [&[&str]; 5] = [&["of"], &["as"], &["by"], &["in"], &["the", "same"]];

/// A word or a mark, in lower case, and its line.
struct Token {
    word: String,
    line: usize,
}

/// The words of a text; the marks of comments are left out, so that a phrase goes on in the next line.
fn tokens(text: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut rest = line.trim_start().trim_start_matches(['/', '!', '#', '*', '>', '|']);
        while let Some(letter) = rest.chars().next() {
            let end = rest.find(|letter: char| !(letter.is_alphanumeric() || letter == '_')).unwrap_or(rest.len());
            let length = if end > 0 { end } else { letter.len_utf8() };
            if !letter.is_whitespace() {
                let word = &rest[..length];
                // The value of Rust and Python, not the word.
                let word = if word == "None" { word.to_owned() } else { word.to_lowercase() };
                tokens.push(Token { word, line: index + 1 });
            }
            rest = &rest[length..];
        }
    }
    tokens
}

fn matches(word: &str, alternatives: &[&str]) -> bool {
    alternatives.iter().any(|alternative| match alternative.strip_suffix('*') {
        Some(prefix) => word.starts_with(prefix),
        None => word == *alternative,
    })
}

/// Lines of a text with a phrase of the list.
fn lines_with_phrases(text: &str) -> Vec<String> {
    let tokens = tokens(text);
    let mut found = Vec::new();
    for start in 0..tokens.len() {
        for phrase in &PHRASES {
            let end = start + phrase.words.len();
            let is_phrase = end <= tokens.len()
                && tokens[start..end].iter().zip(phrase.words).all(|(token, words)| matches(&token.word, words));
            let is_fine = is_phrase
                && (start > 0 && phrase.fine_after.contains(&tokens[start - 1].word.as_str())
                    || tokens.get(end).is_some_and(|token| phrase.fine_before.contains(&token.word.as_str())));
            if is_phrase && !is_fine {
                let words: Vec<&str> = tokens[start..end].iter().map(|token| token.word.as_str()).collect();
                found.push(format!("{}: \"{}\": {}", tokens[start].line, words.join(" "), phrase.instead));
            }
        }
    }
    found
}

/// First lines of documentation that continue something else.
fn lines_with_fragments(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut previous = "";
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        for mark in ["///", "//!"] {
            if let Some(documentation) = line.strip_prefix(mark)
                && !previous.starts_with(mark)
            {
                let words: Vec<String> = tokens(documentation).into_iter().map(|token| token.word).collect();
                if FRAGMENTS.iter().any(|fragment| words.iter().take(fragment.len()).eq(fragment.iter())) {
                    found.push(format!("{}: {line:?}: a full noun phrase or sentence", index + 1));
                }
            }
        }
        previous = line;
    }
    found
}

#[test]
fn comments_messages_and_pages_are_plain_english() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = files(root, &["rs", "md", "toml", "py", "ts", "html", "yml", "yaml"]);
    let scripts = [
        ".ci/run",
        ".ci/quick",
        ".ci/oldest",
        "justfile",
        "docs/site/build",
        "packaging/deb",
        "packaging/workflow/test",
        "packaging/kubernetes/test",
    ];
    files.extend(scripts.map(|script| root.join(script)));
    // This list itself.
    files.retain(|file| !file.ends_with(file!()));
    assert!(files.len() > 1000, "{} files", files.len());
    let mut found = Vec::new();
    for file in files {
        let text = std::fs::read_to_string(&file).expect("text");
        let name = file.strip_prefix(root).expect("inside").display().to_string();
        let is_rust = file.extension().is_some_and(|extension| extension == "rs");
        let fragments = if is_rust { lines_with_fragments(&text) } else { Vec::new() };
        found.extend(lines_with_phrases(&text).into_iter().chain(fragments).map(|line| format!("{name}:{line}")));
    }
    assert!(found.is_empty(), "{} wordings to replace:\n{}", found.len(), found.join("\n"));
}

#[test]
fn phrase_is_found_across_lines_and_good_english_is_not() {
    let text = "/// The pose is that\n/// of the body, too.\nlet x = 1; // there is no fix; it is no longer valid\n";
    let found = lines_with_phrases(text);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].starts_with("1: ") && found[1].starts_with("2: "), "{found:?}");
    let fragments = lines_with_fragments("/// Of the body.\nfn a() {}\n/// Pose\n/// of the body.\nfn b() {}\n");
    assert_eq!(fragments.len(), 1, "{fragments:?}");
}
