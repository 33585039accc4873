-- Results carry a checksum that their worker made, and say for how long the wheel was in the air. Schemas of both
-- databases have the same number from here on.

-- Share of the recorded time, 0 to 1, in which the wheel did not touch the rail; null where nobody told it.
alter table result add column contact_loss_share real
    constraint contact_loss_share_is_one check (contact_loss_share between 0 and 1);

-- Of the case's passes together, the same in each of its rows (docs/checksums.md); null where the result was stored
-- before there were any.
alter table result add column checksum text;

-- Cases whose wheel was in the air: few, and counted often.
create index result_with_contact_loss on result (campaign_id, sobol_index, contact_loss_share)
    where contact_loss_share > 0;

drop view result_with_parameters;

-- One row a case and speed: what went in, and what came out.
create view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged,
    result.contact_loss_share,
    result.checksum
from result
join campaign_case using (campaign_id, sobol_index);
