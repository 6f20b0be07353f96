"""An environment with one policy and one request, on this machine."""

import verifiers.v1 as vf
from verifiers.v1.envs.single_agent import SingleAgentEnvConfig
from verifiers.v1.harnesses.null import NullHarnessConfig


class TrainingEnvConfig(SingleAgentEnvConfig):
    """Defaults that need no sandbox: the policy only writes text.

    Its programs run in the processes of the simulator, which are isolated wherever the harness runs.
    """

    agent: vf.AgentConfig = vf.AgentConfig(
        harness=NullHarnessConfig(id="null"), runtime=vf.SubprocessConfig()
    )


class TrainingEnv(vf.SingleAgentEnv, vf.Env[TrainingEnvConfig]):
    """The single-agent environment that `vf-replay` and `vf-gepa` require, with these defaults."""
