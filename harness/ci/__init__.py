"""What continuous integration systems read of a run: JUnit, Markdown, annotations."""
