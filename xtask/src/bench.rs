use anyhow::Result;
pub(crate) fn run(_b: bool) -> Result<()> {
    Ok(())
}
