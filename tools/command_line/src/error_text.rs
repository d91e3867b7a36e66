//! The text of an error.

const HINT: &str = "\nhint: ";

/// The error and its causes, separated by colons. Hints follow on separate lines.
pub fn error_text(error: &anyhow::Error) -> String {
    let mut causes = Vec::new();
    let mut hints = String::new();
    for message in error.chain().map(ToString::to_string) {
        match message.split_once(HINT) {
            Some((cause, hint)) => {
                causes.push(cause.to_owned());
                hints.push_str(HINT);
                hints.push_str(hint);
            }
            None => causes.push(message),
        }
    }
    causes.join(": ") + &hints
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::anyhow;

    #[test]
    fn hint_follows_all_causes() {
        let error = anyhow!("No such file").context("a.toml: cannot be read\nhint: --file FILE").context("evaluate");
        assert_eq!(error_text(&error), "evaluate: a.toml: cannot be read: No such file\nhint: --file FILE");
    }
}
