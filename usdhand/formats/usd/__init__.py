"""OpenUSD: UsdSkel characters read into clips, results written as layers."""
