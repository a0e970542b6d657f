"""Run the missing cells as calls, batched into tasks, on local or remote workers.

Input: a plan and the index of a cache. Output: packs of results, failures and progress. A new kind
of executor belongs beside those of `dask_cluster`, and its settings into `cluster`. `store`,
`sweeping`, `command` and `function` may import it.
"""
