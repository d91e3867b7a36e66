//! The text of an error.

const HINT: &str = "\nhint: ";

/// The error and its causes, separated by colons. Hints follow on separate lines. A cause that the text of its error
/// already ends with is not repeated.
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
            None if causes.last().is_some_and(|error: &String| error.ends_with(&message)) => {}
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
    fn cause_that_its_error_names_is_printed_once() {
        let cause = "No such file or directory (os error 2)";
        let error = anyhow!(cause).context(format!("out/summary.json: {cause}")).context("the run is not finished");
        assert_eq!(error_text(&error), format!("the run is not finished: out/summary.json: {cause}"));
    }

    #[test]
    fn hint_follows_all_causes() {
        let error = anyhow!("No such file").context("a.toml: cannot be read\nhint: --file FILE").context("evaluate");
        assert_eq!(error_text(&error), "evaluate: a.toml: cannot be read: No such file\nhint: --file FILE");
    }
}
